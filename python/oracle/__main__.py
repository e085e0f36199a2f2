"""The command line of the oracle: ``python -m oracle LOG``."""

import json
import sys

from . import __doc__ as description
from . import contact_log
from .contact_log import LogError
from .replay import Replay, report


def main() -> int:
    parser = contact_log.parser("oracle", description)
    parser.add_argument("--breaks", type=int, default=sys.maxsize, help="number of breaks to replay (default: all)")
    parser.add_argument("--follow", action="store_true", help="continue from the logged times of breaks (see above)")
    parser.add_argument("--worst", type=float, default=1e-8, help="limit on the worst time error, in s (%(default)g)")
    parser.add_argument("--median", type=float, default=1e-11, help="limit on their median, in s (%(default)g)")
    parser.add_argument("--residual", type=float, default=1e-8, help="limit on the residual, in f_s (%(default)g)")
    options = parser.parse_args()
    try:
        log, parameters = contact_log.read(options)
        result = report(Replay(parameters, log, options.breaks, options.residual, options.follow).run())
    except LogError as error:
        print(f"{options.log}: {error}", file=sys.stderr)
        return 2
    result["within_limits"] = (
        result["worst_time_error"] <= options.worst
        and result["median_time_error"] <= options.median
        and result["worst_residual"] <= options.residual
        and not result["missed"]
    )
    print(json.dumps(result, indent=2))
    return 0 if result["within_limits"] else 1


if __name__ == "__main__":
    sys.exit(main())
