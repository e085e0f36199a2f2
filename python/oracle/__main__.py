"""The command line of the oracle: ``python -m oracle LOG``."""

import json
import sys

from . import __doc__ as description
from . import contact_log
from .contact_log import LogError
from .replay import Replay, report


def table(result: dict) -> str:
    """The result for people."""

    def where(at: dict | None) -> str:
        return f"(break {at['break']}, block {at['block']}, t = {at['time']:.9g} s)" if at else ""

    lines = [
        f"breaks               {result['breaks']}, reattachments {result['reattachments']},"
        f" to t = {result['end_time']:.9g} s",
        f"time error           worst {result['worst_time_error']:.1e} s {where(result['worst_time_error_at'])}",
        f"                     median {result['median_time_error']:.1e} s",
        f"residual             worst {result['worst_residual']:.1e} f_s {where(result['worst_residual_at'])}",
        f"                     median {result['median_residual']:.1e} f_s",
        f"displacement error   worst {result['worst_displacement_error']:.1e} f_s/k",
        f"missed contacts      {len(result['missed'])}",
    ]
    for at in result["missed"][:5]:
        lines.append(f"                     block {at['block']}, contact {at['contact']} from t = {at['time']:.9g} s")
    lines.append(f"unreached breaks     {len(result['unreached'])}")
    lines += [f"                     {where(at)}" for at in result["unreached"][:5]]
    lines.append("within the limits" if result["within_limits"] else "BEYOND the limits")
    return "\n".join(lines)


def main() -> int:
    """Replays the log that the command line names."""
    parser = contact_log.parser("oracle", description)
    parser.add_argument("--breaks", type=int, default=sys.maxsize, help="number of breaks to replay (default: all)")
    parser.add_argument("--follow", action="store_true", help="continue from the logged times of breaks (see above)")
    parser.add_argument("--worst", type=float, default=1e-8, help="limit on the worst time error, in s (%(default)g)")
    parser.add_argument("--median", type=float, default=1e-11, help="limit on their median, in s (%(default)g)")
    parser.add_argument("--residual", type=float, default=1e-8, help="limit on the residual, in f_s (%(default)g)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
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
    print(json.dumps(result, indent=2) if options.json else table(result))
    return 0 if result["within_limits"] else 1


if __name__ == "__main__":
    sys.exit(main())
