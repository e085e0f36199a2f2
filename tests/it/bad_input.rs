//! Bad input, as sweep files and as flags of every command: exit code 2, a message with the key and the way out, and
//! nothing written.

use crate::program::Folder;

/// A small sweep that is right.
const GOOD: &str = "name = \"good\"\n[model]\nN = 3\nNs = 4\n[record]\nslips = 2\n";

/// Runs a command that must be refused with these words, and leave the folder as it is.
#[track_caller]
fn assert_refused(folder: &Folder, arguments: &str, words: &[&str]) {
    let before = folder.contents("");
    let ended = folder.ends(2, arguments);
    assert!(ended.stdout.is_empty(), "{arguments}: {}", ended.stdout);
    for word in words {
        assert!(
            ended.stderr.contains(word),
            "{arguments}: {word:?} is missing in\n{}",
            ended.stderr
        );
    }
    assert!(
        folder.contents("") == before,
        "{arguments}: something was written"
    );
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn bad_sweep_files_are_refused_by_plan_and_run_and_nothing_is_written() {
    // (text below `name = "bad"`, line, words of the message)
    let table: &[(&str, usize, &[&str])] = &[
        // No TOML, unknown keys, wrong types.
        ("[model\nN = 3", 2, &["[model", "TOML"]),
        ("[modle]\nN = 3", 2, &["modle", "did you mean model?"]),
        (
            "V0 = 1e-4",
            2,
            &["V0", "parameters belong in [model] or [axes]"],
        ),
        ("[model]\ngama = 3", 3, &["gama = 3", "did you mean gamma?"]),
        (
            "[model]\nN = \"70\"",
            3,
            &["N = \"70\"", "must be a whole number from 1 to 100000"],
        ),
        (
            "[model]\nNs = 2.5",
            3,
            &["Ns = 2.5", "must be a whole number"],
        ),
        (
            "[model]\nbreak_on = \"force\"",
            3,
            &["break_on = \"force\"", "\"magnitude\"", "\"tension\""],
        ),
        (
            "[record]\nprecursors = 1",
            3,
            &["precursors = 1", "must be true or false"],
        ),
        // Impossible values.
        (
            "[model]\nV0 = nan",
            3,
            &["V0 = nan", "must be a finite number > 0"],
        ),
        (
            "[model]\nfs = inf",
            3,
            &["fs = inf", "must be a finite number > 0"],
        ),
        (
            "[model]\nM = -11.5",
            3,
            &["M = -11.5", "must be a finite number > 0"],
        ),
        (
            "[model]\ntau_r = 0",
            3,
            &["tau_r = 0", "must be a finite number > 0"],
        ),
        (
            "[model]\nseed = -1",
            3,
            &["seed = -1", "must be a whole number from 0 to 2^53 - 1"],
        ),
        (
            "[model]\nN = 0",
            3,
            &["N = 0", "must be a whole number from 1"],
        ),
        ("[model]\ndfs = 2", 3, &["dfs = 2", "dfs <= fs"]),
        (
            "[record]\nslips = 0",
            3,
            &["slips = 0", "must be a whole number from 1"],
        ),
        (
            "[record]\nmax_time = -3",
            3,
            &["max_time = -3", "must be a finite number > 0, in s"],
        ),
        // Modulation without period, period without modulation, two periods.
        (
            "[model]\nDelta = 1e-6",
            3,
            &["Delta > 0", "needs a period; set T"],
        ),
        (
            "[model]\nDelta = 1e-6\nT = -0.01",
            4,
            &["T = -0.01", "must be a finite number > 0"],
        ),
        (
            "[axes]\neta = [1, 2]",
            3,
            &["eta: has no effect while Delta = 0", "set Delta > 0"],
        ),
        (
            "[model]\nDelta = 1e-6\nT = 1\n[axes]\nfrequency = [3]",
            6,
            &["frequency", "T in [model] (line 4)", "keep one"],
        ),
        // Axes and conditions.
        ("[axes]\nV0 = []", 3, &["V0 = []", "at least one value"]),
        (
            "[axes]\nV0 = [1e-4, 1e-4]",
            3,
            &["V0 = 1e-4", "repeats value 1", "keep one"],
        ),
        (
            "[axes]\nV0 = { log = [0, 1], points = 3 }",
            3,
            &["log", "> 0"],
        ),
        (
            "[axes]\nV0 = { log = [1e-5, 1e-4] }",
            3,
            &["points is missing"],
        ),
        (
            "[axes]\nfrequenzy = [3]",
            3,
            &["frequenzy", "did you mean frequency?"],
        ),
        (
            "[axes.zip]\nV0 = [1, 2]\nK = [1]",
            4,
            &["K = [1]", "equal length"],
        ),
        (
            "where = \"V0 > 1\"\n[axes]\nN = [3, 4]",
            2,
            &["where: drops every point; relax it"],
        ),
        (
            "where = \"v < 1\"",
            2,
            &["where", "\"v < 1\"", "not a known quantity"],
        ),
        // The solver.
        (
            "[solver]\nmethod = \"no-such\"",
            3,
            &["method = \"no-such\"", "event-driven", "fixed-step"],
        ),
        (
            "[solver]\ntolerance = 0.5",
            3,
            &["tolerance = 0.5", "must be a number from 1e-12 to 1e-2"],
        ),
        (
            "[solver]\nmethod = \"fixed-step\"",
            2,
            &["dt is missing", "such as dt = 1e-6"],
        ),
        (
            "[solver]\nmethod = \"fixed-step\"\ndt = 5e-6",
            4,
            &["dt = 5e-6 s", "must be below", "limit", "= 4.8719e-6 s"],
        ),
    ];
    assert!(table.len() >= 25);
    let folder = Folder::new();
    for (text, line, words) in table {
        folder.write("bad.toml", &format!("name = \"bad\"\n{text}\n"));
        let place = format!("bad.toml:{line}: ");
        let words: Vec<&str> = std::iter::once(place.as_str())
            .chain(words.iter().copied())
            .collect();
        assert_refused(&folder, "plan bad.toml", &words);
        assert_refused(&folder, "run bad.toml", &words);
    }
    for (name, text, word) in [
        ("none.toml", "", "name is missing"),
        ("name.toml", "name = \"a/b\"", "letters, digits"),
    ] {
        folder.write(name, text);
        assert_refused(
            &folder,
            &format!("run {name}"),
            &[&format!("{name}:1: "), word],
        );
    }
}

#[test]
fn all_errors_of_a_sweep_file_are_reported_at_once() {
    let folder = Folder::new();
    folder.write("bad.toml", "[record]\nslips = 0\n[model]\nN = 0\nM = 0\n");
    let expected = "\
error: bad.toml: has 4 mistakes:
  bad.toml:1: name is missing in the file: it becomes a folder, such as name = \"fig3\"
  bad.toml:2: slips = 0: must be a whole number from 1 to 10000000: a job holds them in memory, 320 bytes each
  bad.toml:4: N = 0: must be a whole number from 1 to 100000
  bad.toml:5: M = 0: must be a finite number > 0, in kg
";
    for command in ["plan bad.toml", "plan bad.toml --json", "run bad.toml"] {
        assert_refused(&folder, command, &[expected]);
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn bad_flags_of_every_command_are_refused_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("good.toml", GOOD);
    folder.write("plain.txt", "no TOML, no directory");
    std::fs::write(folder.path("binary.toml"), [0xff, 0xfe]).unwrap();
    std::fs::create_dir_all(folder.path("theirs/data")).unwrap();
    std::fs::create_dir(folder.path("empty")).unwrap();
    folder.ends(0, "run good.toml --out good");
    folder.ends(0, "run good.toml --out results/usual --no-reduce");
    folder.write("other-model.toml", &GOOD.replace("N = 3", "N = 4"));
    folder.write(
        "other-recording.toml",
        &GOOD.replace("slips = 2", "slips = 3"),
    );
    folder.write(
        "other-solver.toml",
        &format!("{GOOD}[solver]\ntolerance = 1e-7\n"),
    );

    let table: &[(&str, &[&str])] = &[
        ("", &["Usage"]),
        ("frobnicate", &["frobnicate", "Usage"]),
        ("--frobnicate", &["--frobnicate", "Usage"]),
        // Files that cannot be read.
        ("plan", &["<SWEEP.toml|DIR>"]),
        (
            "plan missing.toml",
            &["missing.toml: cannot be read", "check the path"],
        ),
        (
            "plan empty",
            &["empty: is not a results directory", "such as results/"],
        ),
        (
            "plan binary.toml",
            &["binary.toml: is not UTF-8 text; save it as UTF-8"],
        ),
        ("plan good.toml --shard 1/2", &["--shard"]),
        ("run", &["<SWEEP.toml|DIR>"]),
        (
            "run missing.toml",
            &["missing.toml: cannot be read", "check the path"],
        ),
        ("run plain.txt", &["plain.txt:1: ", "TOML"]),
        // Flags of a run.
        (
            "run good.toml --threads 0",
            &["--threads", "must be a whole number from 1 to 1024"],
        ),
        (
            "run good.toml --threads 99999999",
            &["--threads", "must be a whole number from 1 to 1024"],
        ),
        (
            "run good.toml --shard 3/2",
            &["--shard", "1 <= K <= N, such as 2/8"],
        ),
        (
            "run good.toml --shard 0/2",
            &["--shard", "1 <= K <= N, such as 2/8"],
        ),
        (
            "run good.toml --shard half",
            &["--shard", "1 <= K <= N, such as 2/8"],
        ),
        ("run good.toml --fast", &["--fast"]),
        (
            "run good.toml --walltime 55",
            &["--walltime", "write 55m for minutes or 55s for seconds"],
        ),
        // Scripts.
        ("batch pbs good.toml", &["pbs", "slurm, hyperqueue"]),
        (
            "batch slurm good.toml",
            &["--workers <N>", "--threads <N>", "--time <TIME>"],
        ),
        (
            "batch slurm missing.toml --workers 4 --threads 2 --time 1h",
            &["missing.toml: cannot be read"],
        ),
        (
            "batch slurm good.toml --workers 0 --threads 2 --time 1h",
            &["--workers"],
        ),
        (
            "batch slurm good.toml --workers 4 --threads 2 --time 90",
            &["write 90m for minutes or 90s for seconds"],
        ),
        (
            "batch slurm good.toml --workers 4 --threads 2 --time 30s",
            &["must be at least 1m"],
        ),
        (
            "batch slurm good.toml --workers 4 --threads 2 --time 1h --starts 3",
            &["--starts 3: must be >= --workers"],
        ),
        // Directories that belong to something else.
        (
            "run good.toml --out theirs",
            &[
                "theirs: is neither empty nor a results directory",
                "choose another with --out",
            ],
        ),
        (
            "run good.toml --out plain.txt",
            &[
                "plain.txt: is neither empty nor a results directory",
                "--out",
            ],
        ),
        (
            "run other-model.toml --out good",
            &[
                "good: holds other results",
                "model.N: 3 -> 4",
                "undo the change",
            ],
        ),
        (
            "run other-recording.toml --out good",
            &[
                "record.slips: 2 -> 3",
                "add seeds here and keep slips = 2, or choose another directory with --out",
            ],
        ),
        (
            "run other-solver.toml --out good",
            &["solver.tolerance: 0.001 -> 1e-7", "--out"],
        ),
        ("status", &["<DIR>"]),
        (
            "status missing",
            &[
                "missing: there is no such directory; name one that a run made, such as results/fig3",
            ],
        ),
        (
            "reduce ./results/godo/",
            &["there is no such directory; name one"],
        ),
        (
            "verify results/usal",
            &[
                "results/usal: there is no such directory",
                "such as results/fig3",
            ],
        ),
        (
            "status good.toml",
            &["good.toml: is a sweep file; did you mean results/good?"],
        ),
        (
            "status theirs",
            &["theirs: is not a results directory", "such as results/"],
        ),
        (
            "verify plain.txt",
            &["plain.txt: is not a results directory", "such as results/"],
        ),
        (
            "status plain.txt",
            &["plain.txt: is not a results directory", "such as results/"],
        ),
        ("status good --yaml", &["--yaml"]),
        (
            "reduce empty",
            &["empty: is not a results directory", "such as results/"],
        ),
        ("reduce good extra", &["extra"]),
        (
            "plot theirs",
            &["theirs: is not a results directory", "such as results/"],
        ),
        ("plot good --from 3", &["--from"]),
        ("generate completions", &["<SHELL>"]),
        (
            "generate completions tcsh",
            &["tcsh", "bash", "fish", "zsh"],
        ),
    ];
    assert!(table.len() >= 25);
    for (arguments, words) in table {
        assert_refused(&folder, arguments, words);
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn bad_flags_of_a_simulation_are_refused_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("good.toml", GOOD);
    folder.write(
        "grid.toml",
        "name = \"grid\"\n[axes]\nV0 = [1e-5, 1e-4]\nseed = { count = 3 }\n",
    );
    folder.write("plain.txt", "no TOML, no directory");
    std::fs::create_dir(folder.path("empty")).unwrap();

    let table: &[(&str, &[&str])] = &[
        // Parameters of a simulation.
        (
            "simulate --set V0",
            &["--set V0: must be KEY=VALUE, such as --set V0=1e-5"],
        ),
        (
            "simulate --set velocity=3",
            &["velocity = 3: unknown key; did you mean V0?"],
        ),
        (
            "simulate --set delta=1e-6",
            &["delta = 1e-6: unknown key; did you mean Delta"],
        ),
        (
            "simulate --set Delta=1e-6 --set eta=3 --set T=1",
            &["T: fixes the period, as does eta; keep one"],
        ),
        (
            "simulate --set k=3",
            &["k = 3: unknown key; did you mean ki?"],
        ),
        ("run good.toml --slips 10", &["`--set slips=VALUE` sets it"]),
        (
            "plan good.toml --axis seed=8",
            &["must be seed=count:N for N seeds, or [SEED] for a single one"],
        ),
        (
            "plan good.toml --axis V0=1e-5:1e-4",
            &["must be V0=log:LOW:HIGH:POINTS, linear:LOW:HIGH:POINTS or a list"],
        ),
        ("simulate --set =3", &["--set =3: must be KEY=VALUE"]),
        (
            "simulate --set V0=fast",
            &["V0 = \"fast\"", "must be a finite number > 0"],
        ),
        ("simulate --set V0=", &["V0", "must be a finite number > 0"]),
        (
            "simulate --set V0=infinity",
            &["V0 = inf", "must be a finite number > 0"],
        ),
        (
            "simulate --set N=1.5",
            &["N = 1.5", "must be a whole number"],
        ),
        (
            "simulate --set seed=-1",
            &["seed = -1", "must be a whole number from 0"],
        ),
        (
            "simulate --set V0=1e-4 --set V0=2e-4",
            &["--set V0=2e-4", "is set before; keep one"],
        ),
        (
            "simulate --set Delta=1e-6",
            &["Delta > 0", "needs a period; set T"],
        ),
        (
            "simulate --set eta=2",
            &["eta: has no effect while Delta = 0", "set Delta > 0"],
        ),
        (
            "simulate --set V0=fast --slips 0",
            &[
                "in the flags:\n  V0 = \"fast\": must",
                "\n  slips = 0: must be",
            ],
        ),
        (
            "simulate --set break_on=force",
            &["break_on = \"force\"", "\"tension\""],
        ),
        // Its length and its solver.
        (
            "simulate --slips 0",
            &["slips = 0", "must be a whole number from 1"],
        ),
        (
            "simulate --slips -3",
            &["slips = -3", "must be a whole number from 1"],
        ),
        (
            "simulate --slips few",
            &["slips = \"few\"", "must be a whole number from 1"],
        ),
        (
            "simulate --record discard=-1",
            &["discard = -1", "must be a whole number from 0"],
        ),
        (
            "simulate --record energies=1",
            &["energies = 1", "must be true or false"],
        ),
        (
            "simulate --record slip=3",
            &["slip = 3: unknown key in [record]; did you mean slips?"],
        ),
        (
            "simulate --record slips=3 --slips 4",
            &["--set slips=4: slips is set before; keep one"],
        ),
        (
            "simulate --record energies",
            &["--set energies: must be KEY=VALUE, such as --set V0=1e-5"],
        ),
        (
            "simulate --time nan",
            &["max_time = nan", "must be a finite number > 0, in s"],
        ),
        (
            "simulate --time -1",
            &["max_time = -1", "must be a finite number > 0, in s"],
        ),
        (
            "simulate --time soon",
            &["max_time = \"soon\"", "must be a finite number > 0, in s"],
        ),
        (
            "simulate --set method=no-such",
            &["method = \"no-such\": must be \"event-driven\" or \"fixed-step\""],
        ),
        (
            "simulate --set dt=1e-6",
            &["dt = 1e-6: unknown key in [solver]"],
        ),
        (
            "simulate --set method=fixed-step --set dt=1e-6 --set tolerance=1e-6",
            &["tolerance = 1e-6: unknown key in [solver]; allowed are method, dt"],
        ),
        (
            "simulate --set method=fixed-step --set dt=5e-6",
            &["dt = 5e-6 s", "must be below", "= 4.8719e-6 s"],
        ),
        (
            "simulate --set method=fixed-step --set dt=0",
            &["dt = 0", "must be a finite number > 0, in s"],
        ),
        (
            "simulate --set tolerance=1",
            &["tolerance = 1", "must be a number from 1e-12 to 1e-2"],
        ),
        // Its files.
        (
            "simulate --trace missing/trace.parquet",
            &["missing/trace.parquet: its folder does not exist"],
        ),
        ("simulate --map empty", &["empty: must end in .parquet"]),
        (
            "simulate --contacts plain.txt/c.parquet",
            &["plain.txt/c.parquet: its folder does not exist"],
        ),
        (
            "simulate --trace a.parquet --slip-table a.parquet",
            &["a.parquet: is the same file as a.parquet", "its own"],
        ),
        (
            "simulate --plot picture.eps",
            &["picture.eps: must end in .svg, .png or .pdf"],
        ),
        (
            "simulate --plot picture",
            &["picture: must end in .svg, .png or .pdf"],
        ),
        (
            "simulate --plot a.png --time 1 --from 2",
            &["--from 2: must lie before the end, 1 s"],
        ),
        (
            "simulate --plot a.png --from -1",
            &["--from -1: must be a finite number >= 0, in s"],
        ),
        (
            "simulate --trace a.parquet --sample 0",
            &["--sample 0: must be a finite number > 0, in s"],
        ),
        (
            "simulate --set V0=1e-310",
            &[
                "V0 = 1e-310",
                "not so low that slips are over 1e100 s apart",
            ],
        ),
        (
            "simulate --trace a.parquet --sample 1e-12",
            &["--sample", "more than 1e8 samples", "take a longer one"],
        ),
        (
            "simulate --plot a.png --until 0",
            &["--until 0: must be a finite number > 0, the first instant, in s"],
        ),
        (
            "simulate --plot a.png --from 1 --until 1",
            &["--until 1: must be a finite number > 1, the first instant"],
        ),
        (
            "simulate --plot a.png --plot a.png",
            &["a.png: is the same file as a.png", "its own"],
        ),
        (
            "simulate --plot a.png --plot b.eps",
            &["b.eps: must end in .svg, .png or .pdf"],
        ),
        (
            "simulate --plot a.png --panel drop",
            &["--panel", "force, map, both"],
        ),
        ("simulate --panel map", &["--plot"]),
        ("simulate --until 1", &["--plot"]),
        // Its sweep file.
        ("simulate fast", &["fast: cannot be read", "check the path"]),
        (
            "simulate grid.toml",
            &[
                "sweep grid: has 6 jobs",
                "give each axis one value, or use `stickslip run`",
            ],
        ),
        (
            "simulate good.toml --preset fig2",
            &["'[SWEEP.toml]'", "--preset"],
        ),
        (
            "simulate good.toml --set dt=1e-6",
            &["dt = 1e-6: unknown key in [solver]"],
        ),
        (
            "simulate good.toml --set N=0",
            &["in the flags: N = 0: must be"],
        ),
        (
            "run good.toml -o x --axis V0",
            &["--axis V0: must be KEY=VALUES, such as --axis V0=1e-5,1e-4"],
        ),
        (
            "run good.toml -o x --axis V0=[1e-5",
            &["--axis V0=[1e-5: must be V0=VALUES, such as 1e-5,1e-4"],
        ),
        (
            "plan good.toml --axis V0=log:1e-5:1e-3",
            &[
                "V0=log:1e-5:1e-3: must be V0=log:LOW:HIGH:POINTS",
                "number of",
            ],
        ),
        (
            "plan good.toml --axis V0=linear:1e-5",
            &["must be V0=log:LOW:HIGH:POINTS, or linear"],
        ),
        (
            "plan good.toml --axis seed=count",
            &["--axis seed=count: must be seed=count:N"],
        ),
        (
            "plan good.toml --axis T=1,2 --set eta=3",
            &["T in [axes]: fixes the period, as does eta; keep one"],
        ),
        (
            "plan --preset fig2 --axis Delta=1e-6,2e-6",
            &[
                "Delta in [axes]: is set in [axes.zip], too; keep one",
                "edit the file (`stickslip init` writes",
            ],
        ),
        (
            "plan --preset fig2 --set eta=3",
            &["frequency in [axes.zip]: fixes the period, as does eta; keep one"],
        ),
        (
            "plan --preset sliding-velocity --set of=tau_mean --set relative=0.02",
            &["flags: seeds is missing in [precision]"],
        ),
        (
            "plan good.toml --axis slips=1,2",
            &["slips = [1, 2]: unknown key in [axes]"],
        ),
        (
            "init my.toml --question why",
            &["friction, interval, locking, sliding"],
        ),
    ];
    assert!(table.len() >= 25);
    for (arguments, words) in table {
        assert_refused(&folder, arguments, words);
    }
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_replaced_by_one() {
    let folder = Folder::new();
    let _socket = std::os::unix::net::UnixListener::bind(folder.path("socket.parquet")).unwrap();
    assert_refused(
        &folder,
        "simulate --trace socket.parquet",
        &["socket.parquet: is there and is no regular file"],
    );
    folder.write("good.toml", GOOD);
    std::os::unix::fs::symlink("nowhere", folder.path("link")).unwrap();
    assert_refused(
        &folder,
        "run good.toml -o link",
        &[
            "link: is a link that leads nowhere",
            "choose another with --out",
        ],
    );
}
