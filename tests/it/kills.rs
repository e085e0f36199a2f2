//! The built program, killed at random instants many times over: nothing that was committed is lost, run again or there
//! twice, and the tables end with the bytes of an uninterrupted run.

use crate::program::{Folder, MANY, MANY_PARTS, wait};
use std::collections::BTreeSet;
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::time::{Duration, Instant};

/// Sets the number of rounds.
const ROUNDS: &str = "STICKSLIP_KILL_ROUNDS";
const ROUNDS_BY_DEFAULT: u64 = 12;
/// Numbers of committed parts at which a kill must have come.
const MIN_STAGES: usize = 3;
/// Ways to run the sweep; a killed one may be followed by any other.
const WAYS: [&str; 3] = [
    "--threads 2",
    "--threads 1 --no-reduce",
    "--threads 2 --no-reduce",
];

/// A whole number below a bound, not the same in each run of the test: no instant is to be left out for ever.
fn random(bound: u64) -> u64 {
    RandomState::new().hash_one(bound) % bound
}

#[test]
fn a_run_killed_at_random_instants_loses_and_doubles_nothing_and_ends_with_the_same_bytes() {
    let rounds = std::env::var(ROUNDS).map_or(ROUNDS_BY_DEFAULT, |text| text.parse().unwrap());
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    let begin = Instant::now();
    folder.ends(0, "run many.toml --threads 2 --out whole");
    let longest = u64::try_from(begin.elapsed().as_micros()).unwrap();
    let (whole, reduced) = (folder.tables("whole"), folder.contents("whole/reduced"));
    let ends_as_the_whole = |round| {
        folder.ends(0, "run many.toml --out killed");
        assert!(folder.tables("killed") == whole, "round {round}");
        assert!(
            folder.contents("killed/reduced") == reduced,
            "round {round}"
        );
        let staged = folder.contents("killed/run/staging");
        assert!(
            staged.values().all(Option::is_none),
            "round {round}: left in staging: {:?}",
            staged.keys()
        );
        let ids = folder.table("killed", "jobs");
        let ids = ids.texts("job_id");
        assert_eq!(
            (ids.len(), ids.iter().collect::<BTreeSet<_>>().len()),
            (28_000, 28_000),
            "round {round}"
        );
        fs::remove_dir_all(folder.path("killed")).unwrap();
    };
    let (mut killed, mut tries, mut parts_at_kills) = (0, 0, BTreeSet::new());
    // Until the kills have met the sweep at several stages, as most rounds do.
    while killed < rounds || parts_at_kills.len() < MIN_STAGES {
        tries += 1;
        assert!(
            tries < 4 * rounds,
            "of {tries} runs {killed} were killed, with so many parts: {parts_at_kills:?}"
        );
        let round = killed;
        let committed = folder.written("killed");
        let way = WAYS[usize::try_from(random(WAYS.len() as u64)).unwrap()];
        let mut child = folder.start(&format!("run many.toml {way} --out killed"));
        let share_missing = (MANY_PARTS - committed.len()) as u64;
        std::thread::sleep(Duration::from_micros(random(
            longest * share_missing / MANY_PARTS as u64,
        )));
        child.kill().unwrap();
        // One that had ended is no kill; it must have ended well.
        let (code, _, stderr) = wait(child);
        assert!(
            matches!(code, None | Some(0)),
            "round {round}, {way}: {stderr}"
        );
        killed += u64::from(code.is_none());

        let left = folder.tables("killed");
        assert!(
            left.iter()
                .all(|(path, bytes)| whole.get(path) == Some(bytes)),
            "round {round}, {way}"
        );
        let written = folder.written("killed");
        let is_kept = committed
            .iter()
            .all(|(path, time)| written.get(path) == Some(time));
        assert!(
            is_kept,
            "round {round}, {way}: a committed part is lost or was run again"
        );
        if code.is_none() {
            parts_at_kills.insert(written.len());
        }
        // Now and then, so that all stages of a sweep come up.
        if written.len() == MANY_PARTS || random(3) == 0 {
            ends_as_the_whole(round);
        }
    }
    ends_as_the_whole(rounds);
    println!(
        "{killed} runs of {tries} were killed, with so many parts committed: {parts_at_kills:?}"
    );
}
