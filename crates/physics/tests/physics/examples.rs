//! The examples, which cargo builds with the tests, run as the README says.

use std::path::PathBuf;
use std::process::Command;

fn output_of(example: &str) -> String {
    // Beside the folder of this test, under the name of the example.
    let mut path: PathBuf = std::env::current_exe().unwrap();
    path.pop();
    path.pop();
    path.extend(["examples", example]);
    let output = Command::new(&path).output().expect(example);
    assert!(output.status.success(), "{example}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_first_slip_is_that_of_the_slider_of_the_paper() {
    let shown = output_of("one_slip");
    assert!(shown.starts_with("onset       114.12 ms\n"), "{shown}");
    assert_eq!(shown.lines().count(), 5, "{shown}");
}

#[test]
fn a_pulse_advances_the_slip_after_it_and_not_the_one_before() {
    let shown = output_of("pulse");
    let slips: Vec<&str> = shown.lines().collect();
    assert!(
        slips[0].ends_with(", 0.00 ms earlier than in the control"),
        "{shown}"
    );
    assert!(slips[1].contains(" 37.96 ms earlier"), "{shown}");
}
