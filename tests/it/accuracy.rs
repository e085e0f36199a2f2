//! Accuracy on the command line: studies at parameters of one's own.

use crate::program::{Folder, json};

/// Two sets of a fast slider, with seeds, which make no further sets.
const SWEEP: &str = "name = 'mine'\n[model]\nN = 9\nNs = 5\nM = 0.006\nK = 7e7\nKd = 1e8\n\
                     [axes]\nV0 = [1e-4, 2e-4]\nseed = { count = 4 }\n[solver]\ntolerance = 2e-5\n";

#[test]
fn a_study_takes_the_sets_and_the_solver_of_a_sweep_file() {
    let folder = Folder::new();
    std::fs::write(folder.path("mine.toml"), SWEEP).unwrap();
    let printed = json(
        &folder
            .ends(
                0,
                "accuracy mine.toml --quick --seeds 2 --slips 3 --out mine --json",
            )
            .stdout,
    );
    let methods = printed["methods"].as_array().unwrap();
    let solvers: Vec<_> = methods
        .iter()
        .map(|row| (row["method"].as_str().unwrap(), row["setting"].as_f64()))
        .collect();
    assert!(solvers.contains(&("grid", Some(2e-5))), "that of the sweep");
    assert!(
        solvers.contains(&("grid", Some(1e-3))) && solvers.contains(&("taylor", Some(1e-8))),
        "{solvers:?}"
    );
    assert!(solvers.iter().all(|&(method, _)| method != "fixed-step"));
    let velocities: std::collections::BTreeSet<u64> = methods
        .iter()
        .map(|row| row["V0"].as_f64().unwrap().to_bits())
        .collect();
    assert_eq!(velocities, [1e-4_f64, 2e-4].map(f64::to_bits).into());
    let case = methods[0]["case"].as_str().unwrap();
    assert!(case.contains(", N = 9, Ns = 5"), "{case}");
    for name in ["V0-1e-4", "V0-2e-4"] {
        let others = "-N-9-Ns-5-M-0.006-K-7e7-Kd-1e8";
        assert!(
            folder
                .path(&format!("mine/work-precision-{name}{others}.png"))
                .is_file(),
            "{:?}",
            folder.contents("mine")
        );
    }
    // Biases are against other seeds. Where one realisation slides, another alone has no error.
    let mut known = 0;
    for row in printed["biases"].as_array().unwrap() {
        let ends = ["mean_bias_low", "mean_bias", "mean_bias_high"].map(|key| row[key].as_f64());
        if let [Some(low), Some(bias), Some(high)] = ends {
            assert!(low <= bias && bias <= high, "{row}");
            known += 1;
        } else {
            assert!(row["freedom"].is_null(), "{row}");
        }
    }
    assert!(known > 50, "{known}");
}

#[test]
fn a_set_of_flags_is_studied_as_text() {
    let folder = Folder::new();
    let flags = "--set N=9 --set Ns=5 --set M=0.006 --set K=7e7 --set Kd=1e8 --set Delta=1e-6 --set frequency=58";
    let text = folder
        .ends(
            0,
            &format!("accuracy --quick --seeds 1 --slips 3 --threads 1 --out mine {flags}"),
        )
        .stdout;
    assert!(
        text.starts_with("The solver (grid, tolerance 1e-3): ")
            && text.contains("\n-> grid, tolerance 1e-3 "),
        "{text}"
    );
    assert!(
        text.contains("\nV0 = 1e-4 m/s, Delta = 1e-6 m, 1/T = 58 Hz, N = 9, Ns = 5"),
        "{text}"
    );
    assert!(text.contains("interval (%)"), "{text}");
}

#[test]
fn a_sweep_gets_its_verdict_in_the_first_lines_and_the_result_beside_its_own() {
    let folder = Folder::new();
    std::fs::write(folder.path("mine.toml"), SWEEP).unwrap();
    let ended = folder.ends(
        0,
        "accuracy mine.toml --quick --seeds 2 --slips 3 --set V0=1e-4",
    );
    let lines: Vec<&str> = ended.stdout.lines().collect();
    assert!(
        lines[0].starts_with("Your sweep (grid, tolerance 2e-5): "),
        "{}",
        lines[0]
    );
    assert!(lines[0].contains("too few slips: "), "{}", lines[0]);
    assert!(
        lines[1].contains("breaks are off by")
            && lines[2].starts_with("Energy balances to ")
            && lines[3].contains("Statistical error"),
        "{}",
        ended.stdout
    );
    assert!(
        lines.len() < 30 && ended.stdout.contains("\n-> grid, tolerance 2e-5 "),
        "{}",
        ended.stdout
    );
    // What so few slips cannot decide is no bias in the table either.
    assert!(!ended.stdout.contains(" ± "), "{}", ended.stdout);
    let report =
        std::fs::read_to_string(folder.path("results/mine-accuracy/accuracy.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["verdict"][0], lines[0]);
}

#[test]
fn other_seeds_are_those_of_the_sweep_and_give_other_slips() {
    let folder = Folder::new();
    std::fs::write(folder.path("mine.toml"), SWEEP).unwrap();
    let means = |seed: &str| -> Vec<f64> {
        let study =
            format!("accuracy mine.toml --quick --seeds 2 --slips 3 --set V0=1e-4{seed} --json");
        let printed = json(&folder.ends(0, &study).stdout);
        assert_eq!(
            printed["first_seed"].as_u64(),
            Some(if seed.is_empty() { 0 } else { 70 })
        );
        let rows = printed["biases"].as_array().unwrap();
        rows.iter()
            .map(|row| row["mean"].as_f64().unwrap())
            .collect()
    };
    let (usual, others) = (means(""), means(" --set seed=70"));
    assert!(
        usual.len() == others.len() && usual.iter().zip(&others).all(|(one, other)| one != other)
    );
}

#[test]
fn what_cannot_be_studied_is_refused() {
    let folder = Folder::new();
    let many = SWEEP.replace("[1e-4, 2e-4]", "{ log = [1e-5, 1e-4], points = 13 }");
    std::fs::write(folder.path("many.toml"), many).unwrap();
    std::fs::write(
        folder.path("none.toml"),
        format!("where = ['V0 > 1']\n{SWEEP}"),
    )
    .unwrap();
    for (arguments, problem) in [
        ("many.toml", "more than 12 sets"),
        ("none.toml", "drops every point"),
        ("--set Foo=3", "unknown key"),
        ("--set V0", "must be KEY=VALUE"),
        (
            "--preset fig2 -o many.toml",
            "--out many.toml: must be a folder",
        ),
    ] {
        let ended = folder.ends(2, &format!("accuracy {arguments}"));
        assert!(
            ended.stderr.contains(problem),
            "{arguments}: {}",
            ended.stderr
        );
    }
    let sliding = folder.ends(
        3,
        "accuracy --set V0=1e-3 --quick --seeds 1 --slips 3 --out mine",
    );
    assert!(sliding.stderr.contains("no slips"), "{}", sliding.stderr);
    assert!(!folder.path("mine").exists() && !folder.path("results").exists());
}
