//! The report of a results directory: what its page holds. How it looks and works is tested in tests/browser.

use crate::program::{FAILING, Folder, MANY, json, wait};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::read::GzDecoder;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::fs;
use std::time::{Duration, Instant};

const SWEEP: &str = "\
name = \"modulated\"
[model]
N = 3
Ns = 4
[axes]
Delta = [0, 1e-6]
frequency = [90]
V0 = [1e-4, 2e-4]
seed = { count = SEEDS }
[record]
slips = 6
";
/// Relative error of the numbers of slips: five digits.
const PRECISION: f64 = 5e-5;

fn sweep(seeds: u32) -> String {
    SWEEP.replace("SEEDS", &seeds.to_string())
}

/// What a page holds.
pub fn unpacked(page: &str) -> Value {
    let data = page
        .split_once("id=\"data\">")
        .unwrap()
        .1
        .split_once('<')
        .unwrap()
        .0;
    let packed = BASE64_STANDARD.decode(data).unwrap();
    serde_json::from_reader(GzDecoder::new(packed.as_slice())).unwrap()
}

pub fn page(folder: &Folder, name: &str) -> String {
    fs::read_to_string(folder.path(name)).unwrap()
}

/// A column of the page's slips, without nulls.
fn slip_column(content: &Value, name: &str) -> Vec<f64> {
    let slips = &content["slips"];
    let place = slips["columns"]
        .as_array()
        .unwrap()
        .iter()
        .position(|column| column["name"] == name)
        .unwrap();
    slips["values"][place]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_f64)
        .collect()
}

#[test]
fn a_report_has_every_slip_with_its_set_and_its_seed() {
    let folder = Folder::new();
    folder.write("s.toml", &sweep(3));
    let ended = folder.ends(0, "run s.toml --out r --report");
    assert!(
        ended.stdout.ends_with("report  r/report.html\n"),
        "{}",
        ended.stdout
    );
    let content = unpacked(&page(&folder, "r/report.html"));
    let slips = folder.table("r", "slips");
    assert_eq!(content["slips"]["every"], 1);
    for name in ["interval", "phase", "peak_force"] {
        let (shown, written) = (slip_column(&content, name), slips.reals(name));
        assert_eq!(shown.len(), written.len(), "{name}");
        assert!(
            shown
                .iter()
                .zip(&written)
                .all(|(a, b)| (a - b).abs() <= PRECISION * b.abs()),
            "{name}"
        );
    }
    let ids = &content["sets"]["values"][0];
    let jobs = content["slips"]["jobs"].as_array().unwrap();
    let place = |job: &Value| usize::try_from(job[0].as_u64().unwrap()).unwrap();
    let of_jobs = jobs
        .iter()
        .map(|job| (ids[place(job)].as_str().unwrap(), job[1].as_i64().unwrap()));
    let mut expected: Vec<_> = slips
        .texts("set_id")
        .into_iter()
        .zip(slips.counts("seed"))
        .collect();
    expected.dedup();
    assert_eq!(of_jobs.collect::<Vec<_>>(), expected);
    let counted: u64 = content["sets"]["histograms"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|bins| bins.as_array().unwrap().chunks(2))
        .map(|bin| bin[1].as_u64().unwrap())
        .sum();
    assert_eq!(counted, slips.reals("interval").len() as u64);
    assert_eq!(
        json(&folder.ends(0, "verify r --json").stdout)["whole"],
        true
    );
}

#[test]
fn failed_jobs_are_there_with_commands_that_fail_in_the_same_way() {
    let folder = Folder::new();
    folder.write("failing.toml", FAILING);
    folder.ends(1, "run failing.toml --out r --report");
    let content = unpacked(&page(&folder, "r/report.html"));
    let failures = content["status"]["failures"].as_array().unwrap();
    assert_eq!(failures.len(), 2);
    for failure in failures {
        let command = failure["command"]
            .as_str()
            .unwrap()
            .strip_prefix("stickslip ")
            .unwrap();
        let alone = folder.ends(1, command);
        assert_eq!(
            alone.stderr,
            format!("error: {}\n", failure["reason"].as_str().unwrap())
        );
    }
}

#[test]
fn no_text_of_a_sweep_becomes_html() {
    let hostile = "# </script><script>alert(1)</script><!-- <img src=x onerror=alert(2)> \u{2028} {{data}} '\"&\n";
    let folder = Folder::new();
    folder.write("s.toml", &format!("{hostile}{}", sweep(1)));
    let directory = "</script><script>alert(3)";
    fs::create_dir(folder.path("<")).unwrap();
    folder.ends(0, &format!("run s.toml --out {directory} --no-reduce"));
    folder.ends(0, &format!("report {directory} -o page.html"));
    let page = page(&folder, "page.html");
    assert!(!page.contains("alert("));
    assert_eq!(
        (
            page.matches("<script").count(),
            page.matches("</script>").count()
        ),
        (2, 2)
    );
    assert!(page.is_ascii() || !page.contains('\u{2028}'));
    let content = unpacked(&page);
    assert!(content["sweeps"][0].as_str().unwrap().starts_with(hostile));
    assert_eq!(content["directory"], directory);
}

#[test]
fn a_page_names_no_other_file() {
    let folder = Folder::new();
    folder.write("s.toml", &sweep(1));
    folder.ends(0, "run s.toml --out r --report");
    let page = page(&folder, "r/report.html");
    assert!(page.contains("default-src 'none'"));
    for loads in ["src=", "href=\"h", "url(", "@import", "//cdn"] {
        assert!(!page.contains(loads), "{loads}");
    }
}

#[test]
fn a_report_is_that_of_the_tables_as_they_are_and_the_same_when_written_again() {
    let folder = Folder::new();
    folder.write("s.toml", &sweep(1));
    folder.ends(0, "run s.toml --out r --no-reduce");
    let written = folder.ends(0, "report r").stdout;
    assert_eq!(written, "r/report.html\n");
    let first = page(&folder, "r/report.html");
    folder.ends(0, "report r -o page.html");
    assert_eq!(page(&folder, "page.html"), first);
    folder.write("s.toml", &sweep(4));
    folder.ends(0, "run s.toml --out r --no-reduce");
    folder.ends(0, "report r");
    let jobs = |page: &str| unpacked(page)["slips"]["jobs"].as_array().unwrap().len();
    assert_eq!(
        (jobs(&first), jobs(&page(&folder, "r/report.html"))),
        (4, 16)
    );
}

#[test]
fn a_directory_without_jobs_has_no_report() {
    let folder = Folder::new();
    fs::create_dir(folder.path("r")).unwrap();
    let ended = folder.ends(2, "report r");
    assert!(
        ended.stderr.contains("not a results directory") || ended.stderr.contains("manifest"),
        "{}",
        ended.stderr
    );
    let ended = folder.ends(2, "run s.toml --report --no-reduce");
    assert!(ended.stderr.contains("--no-reduce"), "{}", ended.stderr);
}

#[test]
fn the_page_reloads_while_a_run_continues_and_no_longer_when_it_has_stopped() {
    let folder = Folder::new();
    folder.write("many.toml", &MANY.replace("28000", "4000000"));
    let mut child = folder.start("run many.toml --out r --report --threads 1");
    let begin = Instant::now();
    while !folder.path("r/report.html").exists() {
        assert!(
            child.try_wait().unwrap().is_none() && begin.elapsed() < Duration::from_mins(2),
            "no report"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    let content = unpacked(&page(&folder, "r/report.html"));
    assert!(
        content["live"]["refresh"].as_f64().unwrap() >= 5.0,
        "{}",
        content["live"]
    );
    assert!(content["status"]["jobs_missing"].as_u64().unwrap() > 0);
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let (code, _, stderr) = wait(child);
    assert_eq!(code, Some(3), "{stderr}");
    let content = unpacked(&page(&folder, "r/report.html"));
    assert_eq!(content["live"], Value::Null);
    assert!(content["status"]["jobs_missing"].as_u64().unwrap() > 0);
}
