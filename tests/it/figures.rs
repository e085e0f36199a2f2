//! Figures: a sweep gets those whose data it has, and one's own show what their options say.

use crate::program::Folder;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Always there under modulation, and with more than one period.
const MODULATED: [&str; 2] = ["phi-eta", "tau-T"];

#[test]
fn each_sweep_gets_the_figures_that_fit_it() {
    let table: &[(&str, &[&str])] = &[
        (
            "Delta = { log = [1e-7, 2e-6], points = 8 }\nfrequency = { log = [20, 400], points = 8 }",
            &["locking-map"],
        ),
        (
            "Delta = [0, 1e-6]\nfrequency = { linear = [20, 400], points = 24 }",
            &["overview"],
        ),
        (
            "Delta = { linear = [0, 2e-6], points = 8 }\nfrequency = { linear = [20, 400], points = 7 }",
            &["overview"],
        ),
        (
            "Delta = [0, 1e-6]\nfrequency = [90]\ntau_r = [1e-3, 2e-3, 5e-3]",
            &["overview", "tau-histograms"],
        ),
        (
            "Delta = [0, 1e-6]\nfrequency = [90]\nbreak_on = [\"magnitude\", \"tension\"]",
            &["overview", "tau-histograms"],
        ),
        (
            "Delta = [0, 5e-7, 1e-6, 2e-6, 4e-6]\nfrequency = [90]",
            &["overview"],
        ),
        (
            "Delta = [0, 1e-6]\nfrequency = [90]",
            &["overview", "tau-histograms"],
        ),
    ];
    let folder = Folder::new();
    for (index, (axes, expected)) in table.iter().enumerate() {
        let text =
            format!("name = \"s\"\n[model]\nN = 3\nNs = 4\n[axes]\n{axes}\n[record]\nslips = 4\n");
        folder.write("sweep.toml", &text);
        folder.ends(0, &format!("run sweep.toml --out r{index}"));
        let figures = folder.contents(&format!("r{index}/figures"));
        let modulated = if axes.contains("[90]") {
            &MODULATED[..1]
        } else {
            &MODULATED
        };
        let mut names: Vec<String> = modulated
            .iter()
            .chain(*expected)
            .map(|name| (*name).to_owned())
            .collect();
        names.sort();
        for extension in ["png", "svg"] {
            let drawn = figures
                .keys()
                .filter(|path| path.extension().unwrap() == extension);
            let mut drawn: Vec<String> = drawn
                .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
                .collect();
            drawn.sort();
            assert_eq!(drawn, names, "{extension}: {axes}");
        }
    }
}

/// A sweep with something on each axis: velocities, two amplitudes, words.
const OWN: &str = "\
name = \"own\"
[model]
N = 3
Ns = 4
[axes]
V0 = { log = [1e-5, 1e-3], points = 8 }
Delta = [0, 1e-6]
frequency = [90]
seed = { count = 2 }
[record]
slips = 4
";

fn own() -> Folder {
    let folder = Folder::new();
    folder.write("own.toml", OWN);
    folder.ends(0, "run own.toml --out r --threads 2");
    folder
}

#[test]
fn each_slip_is_a_dot_with_the_unit_of_its_column_or_formula() {
    let folder = own();
    let svg = |options: &str| {
        folder.ends(0, &format!("plot r --of slips -o own.svg {options}"));
        fs::read_to_string(folder.path("own.svg")).unwrap()
    };
    let plain = svg("--x interval --y drop");
    let slips = folder.table("r", "slips").reals("drop").len();
    // The legend has dots, too.
    assert!(plain.matches("<circle").count() >= slips);
    for text in [
        "Interval τ (ms)",
        "Force drop ΔF (N)",
        &format!("{slips} slips"),
    ] {
        assert!(plain.contains(text), "{text}");
    }
    let chosen = svg("--x V0*interval --y sqrt(drop/peak_force) --where slip==2 --panels Delta");
    for text in ["V₀·τ (µm)", ">√(ΔF/F)<", ">(b)<", "slip==2;"] {
        assert!(chosen.contains(text), "{text}");
    }
    // Against what was swept, the means of slips have intervals.
    folder.ends(0, "plot r --x V0 --y precursors -o own.svg");
    let means = fs::read_to_string(folder.path("own.svg")).unwrap();
    assert!(means.contains(">Precursors before the slip<") && means.contains("bars: 95 %"));
    folder.screens(
        "show_means_of_slips",
        [
            "show r --columns next_interval,drop/peak_force",
            "show r --columns phase",
        ],
    );
    for (options, words) in [
        (
            "--of slips --x block --y drop",
            "did you mean nucleation_block?",
        ),
        ("--x wear --y tau_mean", "--x wear: no such column"),
        (
            "--of slips --x V0 --y drop --where V0==1",
            "slips matches; V0 nearest to 1:",
        ),
        ("--of slips", "--x"),
    ] {
        let error = folder.ends(2, &format!("plot r {options}")).stderr;
        assert!(error.contains(words), "{options}: {error}");
    }
}

#[test]
fn each_option_of_a_figure_changes_what_it_says() {
    let folder = own();
    let svg = |options: &str| {
        folder.ends(
            0,
            &format!("plot r --x V0 --y tau_mean -o own.svg {options}"),
        );
        fs::read_to_string(folder.path("own.svg")).unwrap()
    };
    let plain = svg("");
    for text in [
        "Drive velocity V₀ (m/s)",
        ">10⁻⁴<",
        "Mean interval ⟨τ⟩ (ms)",
        ">Δ = 1 µm<",
        "Sweep own",
    ] {
        assert!(plain.contains(text), "{text}");
    }
    for (options, text) in [
        ("--log none", "Drive velocity V₀ (10⁻³ m/s)"),
        ("--log y --ylim 1e-4:10", ">1000<"),
        ("--colour frequency", ">1/T = 90 Hz<"),
        ("--colour V0", ">V₀ (m/s)<"),
        ("--panels Delta", ">(b)<"),
        (
            "--xlim 1e-5:1e-4 --size 250mmx90mm",
            "not shown: 9 of 16 sets",
        ),
        ("--xlabel speed", ">speed<"),
        // XML cannot hold it.
        ("--xlabel a\u{fffe}b", ">a\u{fffd}b<"),
        ("--ylabel τ", ">τ<"),
        ("--ylabel \u{7}", r">\u{7}<"),
        ("--style print", r#"width="86.00mm""#),
        (
            "--size 100mmx90mm --style print",
            r#"width="100.00mm" height="90.00mm""#,
        ),
    ] {
        assert!(
            svg(options).contains(text) && !plain.contains(text),
            "{options}: {text}"
        );
    }
    // A journal has the small print in the caption.
    assert!(!svg("--style print").contains("Sweep own"));
    let print = folder.ends(0, "plot r --x V0 --y tau_mean -o own.svg --style print");
    assert!(
        print
            .stderr
            .starts_with("for the caption: Sweep own; N = 3"),
        "{}",
        print.stderr
    );
    // Joined sets, bars and dots have the same numbers in print.
    let dots = |svg: &str| svg.matches("<circle").count() + svg.matches("<use").count();
    assert_eq!(dots(&svg("--style print")), dots(&plain));
}

#[test]
fn figures_come_in_the_formats_that_are_asked_for_and_are_the_same_each_time() {
    let folder = own();
    folder.ends(
        0,
        "plot r --x V0 --y tau_mean --log xy --format svg,png,pdf",
    );
    let contents = folder.contents("r/figures");
    for (format, start) in [
        ("svg", &b"<svg"[..]),
        ("png", b"\x89PNG"),
        ("pdf", b"%PDF-1."),
    ] {
        let bytes = contents[Path::new(&format!("tau_mean-V0.{format}"))]
            .as_ref()
            .unwrap();
        assert!(bytes.starts_with(start), "{format}");
    }
    let standing = folder.ends(0, "plot r --format pdf --style print").stdout;
    assert!(
        standing.lines().count() > 1
            && standing
                .lines()
                .all(|line| Path::new(line).extension().is_some_and(|end| end == "pdf")),
        "{standing}"
    );
    let before = folder.contents("r/figures");
    folder.ends(
        0,
        "plot r --x V0 --y tau_mean --log xy --format svg,png,pdf",
    );
    folder.ends(0, "plot r --format pdf --style print");
    assert!(folder.contents("r/figures") == before);
    folder.ends(0, "plot r --x V0 --y tau_mean -o own.pdf");
    let pdf = fs::read(folder.path("own.pdf")).unwrap();
    let text = String::from_utf8_lossy(&pdf);
    assert!(
        text.trim_end().ends_with("%%EOF") && text.contains("/MediaBox"),
        "one whole page"
    );
}

#[test]
fn mistakes_in_a_figure_are_refused_with_what_to_do_and_nothing_is_written() {
    let folder = own();
    let before = folder.contents("");
    let table: &[(&str, &[&str])] = &[
        ("--x V0", &["--y <COLUMN>"]),
        ("--colour V0", &["--x <COLUMN>"]),
        (
            "--x v0 --y tau_mean",
            &["--x v0: no such column; did you mean V0?", "--list"],
        ),
        (
            "--x V0 --y nothing_like_it",
            &["--y nothing_like_it: no such column; `stickslip plot --list` shows all"],
        ),
        (
            "--x regime --y tau_mean --log x",
            &["--log x: regime holds words"],
        ),
        (
            "--x V0 --y T_to",
            &["--y T_to: none of the sets has a value of both V0 and T_to"],
        ),
        (
            "--x V0 --y tau_mean --xlim 1:2",
            &["none of 12 sets lies within --xlim and --ylim"],
        ),
        (
            "--x V0 --y tau_mean --where V0==1",
            &["--where V0==1: none of 16 sets matches; V0 nearest to 1: "],
        ),
        (
            "--x V0 --y tau_mean --xlim 2:1",
            &["--xlim 2:1", "less than the upper"],
        ),
        (
            "--x V0 --y tau_mean --xlim 1",
            &["must be LOW:HIGH", "1e-6:1e-3"],
        ),
        (
            "--x V0 --y tau_mean --log x --xlim -1:1",
            &["--xlim -1:1: must be > 0 on a logarithmic axis"],
        ),
        (
            "--x V0 --y tau_mean --panels tau_mean",
            &["--panels tau_mean: has 12 values, and 9 panels fit"],
        ),
        (
            "--x set_id --y tau_mean",
            &["--x set_id: has 16 words, and 12 fit an axis"],
        ),
        (
            "--x V0 --y tau_mean --colour set_id",
            &["--colour set_id: has 16 words, and there are 6 colours"],
        ),
        (
            "--x V0 --y tau_mean --size 5mmx5mm",
            &["--size: figure tau_mean-V0 needs at least "],
        ),
        (
            "--x V0 --y tau_mean --size 5",
            &["must be WIDTHxHEIGHT", "86mmx60mm"],
        ),
        (
            "--size 5mmx5mm",
            &["--size: figure overview needs at least "],
        ),
        ("--size 2mx2m", &["must be WIDTHxHEIGHT"]),
        (
            "--size 2000mmx2000mm --style print",
            &["a PNG of 2232 million pixels", "the most is 100 million"],
        ),
        ("--format eps", &["svg, png, pdf"]),
        (
            "--x V0 --y tau_mean --with r --legend one",
            &["--legend one: 2 directories"],
        ),
        ("--style poster", &["screen, print"]),
        (
            "--x V0 --y tau_mean -o own.eps",
            &["own.eps: must end in .svg, .png or .pdf"],
        ),
    ];
    for (options, words) in table {
        let ended = folder.ends(2, &format!("plot r {options}"));
        for word in *words {
            assert!(
                ended.stderr.contains(word),
                "{options}: {word:?} is missing in\n{}",
                ended.stderr
            );
        }
    }
    for option in ["xlabel", "ylabel"] {
        let long = format!("plot r --x V0 --y tau_mean --{option} {}", "W".repeat(1001));
        let problem =
            format!("--{option} WWWWWWWWWWWWWWWWWWWW…: has 1001 characters; it may have 1000");
        assert!(folder.ends(2, &long).stderr.contains(&problem));
    }
    assert!(folder.contents("") == before);
}

#[test]
fn letters_that_the_font_lacks_are_named_in_every_format_and_text() {
    let folder = own();
    folder.ends(0, "run own.toml --out 振幅 --threads 2");
    let name = "font of figures lacks ";
    for format in ["svg", "png", "pdf"] {
        let plot = format!("plot r --x V0 --y tau_mean -o own.{format}");
        assert_eq!(folder.ends(0, &plot).stderr, "", "{format}");
        let said = folder.ends(0, &format!("{plot} --ylabel 频率τ频")).stderr;
        assert!(
            said.contains(&format!("{name}率 频: boxes")),
            "{format}: {said}"
        );
    }
    for options in [
        "--with 振幅",
        "--with r --legend 振 --legend 幅",
        "--x V0 --y tau_mean --with 振幅",
    ] {
        let said = folder.ends(0, &format!("plot r {options}")).stderr;
        assert!(
            said.contains(&format!("{name}幅 振: boxes")),
            "{options}: {said}"
        );
    }
}

#[test]
fn sets_without_modulation_stand_in_every_panel_of_a_period() {
    let folder = Folder::new();
    let sweep = |amplitudes: &str| {
        format!(
            "name = \"s\"\n[model]\nN = 3\nNs = 4\n[axes]\nKd = [1e7, 2e7, 3e7, 4e7]\nDelta = {amplitudes}\neta = [2, 5]\n\
             seed = {{ count = 2 }}\n[record]\nslips = 6\n"
        )
    };
    for (directory, amplitudes) in [("with", "[0, 1e-6, 2e-6]"), ("without", "[1e-6, 2e-6]")] {
        folder.write("sweep.toml", &sweep(amplitudes));
        folder.ends(0, &format!("run sweep.toml --out {directory}"));
        let overview = format!("{directory}/figures/overview.svg");
        let overview = fs::read_to_string(folder.path(&overview)).unwrap();
        assert!(
            !overview.contains("pooled") && overview.contains(">η = 5<"),
            "{directory}"
        );
        assert_eq!(overview.contains(">Δ = 0<"), directory == "with");
    }
    folder.ends(0, "plot with --x Kd --y tau_mean --panels eta -o own.svg");
    let own = fs::read_to_string(folder.path("own.svg")).unwrap();
    assert!(
        own.contains(">(b)<") && !own.contains(">(c)<"),
        "no panel of its own"
    );
    // Pentagons in the colour of what is off: four sets in either panel, and the legend's dot.
    let marks = own.split("<path").skip(1);
    let paths = marks.filter_map(|mark| mark.split("/>").next());
    let pentagons = paths.filter(|path| path.contains("#000000") && path.matches('L').count() == 5);
    assert_eq!(pentagons.count(), 2 * 4 + 1, "{own}");
}

#[test]
fn the_list_of_columns_is_that_of_the_table_and_all_of_its_numbers_can_be_drawn() {
    let folder = own();
    let list = folder.ends(0, "plot --list").stdout;
    assert!(
        list.lines()
            .any(|line| line.starts_with("V0 ") && line.ends_with("drive velocity")),
        "{list}"
    );
    let names: BTreeSet<&str> = list
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(names.contains("tau_mean_low") && names.len() > 60);
    // A number of the table, a flag and a word.
    for name in [
        "eta",
        "jobs",
        "has_phase",
        "regime",
        "phase_mean",
        "mean_friction",
    ] {
        folder.ends(0, &format!("plot r --x V0 --y {name} -o {name}.svg"));
    }
}

/// Sweeps over one to four parameters, drawn by a fixed rule: each has a figure that says what it shows.
#[test]
fn every_sweep_has_a_figure_without_raw_names_and_without_an_empty_panel() {
    const AXES: [&str; 8] = [
        "V0 = { log = [1e-5, 1e-2], points = 5 }",
        "Kd = [1e7, 4e7]",
        "tau_r = [1e-3, 5e-3, 2e-2]",
        "dfs = [0, 6.9e-3, 0.1, 0.3]",
        "break_on = [\"magnitude\", \"tension\"]",
        "N = [3, 5, 9]",
        "Delta = [0, 1e-6]\nfrequency = [29, 58, 90]",
        "[axes.sobol]\npoints = 6\nDelta = { log = [1e-7, 2e-6] }\neta = { log = [0.5, 20] }",
    ];
    let (folder, mut state) = (Folder::new(), 9_u32);
    let mut draw = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        usize::try_from(state >> 16).unwrap() % below
    };
    for index in 0..12 {
        let mut axes: Vec<&str> = Vec::new();
        while axes.len() <= index % 4 {
            let axis = AXES[draw(AXES.len())];
            let keys = |axis: &str| axis.split(['\n', '=']).next().unwrap().trim().to_owned();
            let has_modulation = |axis: &str| axis.contains("Delta");
            let clashes = |other: &&str| {
                keys(other) == keys(axis) || (has_modulation(other) && has_modulation(axis))
            };
            if !axes.iter().any(clashes) {
                axes.push(axis);
            }
        }
        let model = if axes.iter().any(|axis| axis.starts_with("N ")) {
            ""
        } else {
            "N = 5\n"
        };
        // A table comes after what stands alone.
        axes.sort_by_key(|axis| axis.starts_with('['));
        let axes = axes.join("\n");
        let text =
            format!("name = \"s\"\n[model]\n{model}Ns = 5\n[axes]\n{axes}\n[record]\nslips = 4\n");
        folder.write("sweep.toml", &text);
        folder.ends(0, &format!("run sweep.toml --out r{index}"));
        assert!(
            panels_are_full(&folder, &format!("r{index}"), &axes) > 0,
            "{axes}"
        );
    }
}

/// The number of figures of a directory. None has the name of a column in it, or a panel where nothing is drawn.
fn panels_are_full(folder: &Folder, directory: &str, sweep: &str) -> usize {
    let figures = folder.contents(&format!("{directory}/figures"));
    let svgs: Vec<String> = figures
        .iter()
        .filter(|(path, _)| path.extension().is_some_and(|extension| extension == "svg"))
        .map(|(_, bytes)| String::from_utf8(bytes.clone().unwrap()).unwrap())
        .collect();
    for svg in &svgs {
        let texts = svg
            .split("<text")
            .skip(1)
            .map(|text| text.split(['>', '<']).nth(1).unwrap());
        let names = texts.filter(|text| text.contains('_'));
        assert_eq!(names.collect::<Vec<_>>(), [""; 0], "{sweep}");
        // What is drawn inside a frame comes between the clip and its end, dots after it.
        for panel in svg.split("clip-path=\"").skip(1) {
            assert!(
                ["<circle", "<rect", "stroke=\"none\""]
                    .iter()
                    .any(|mark| panel.contains(mark)),
                "{sweep}"
            );
        }
    }
    svgs.len()
}

/// With a slider of five blocks, four slips and two seeds of each set of a sweep in rounds.
#[test]
fn the_sweeps_of_this_project_have_figures() {
    let folder = Folder::new();
    for file in fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/sweeps")).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let text = fs::read_to_string(&path).unwrap();
        let has = |key: &str| {
            text.lines()
                .any(|line| line.split([' ', '=']).next() == Some(key))
        };
        let is_many = |count: &str| {
            let digits = count.split(|letter: char| !letter.is_ascii_digit());
            digits.flat_map(str::parse::<u32>).next() > Some(16)
        };
        let smaller = text.lines().map(|line| match line.split_once('=') {
            Some((key, _)) if key.trim() == "seeds" => "seeds = { from = 2, to = 2 }",
            Some((key, count)) if key.trim() == "seed" && is_many(count) => "seed = { count = 8 }",
            _ => line,
        });
        folder.write("sweep.toml", &smaller.collect::<Vec<_>>().join("\n"));
        let settings = [
            ("N", !has("N"), 5),
            ("Ns", true, 5),
            ("slips", has("slips"), 4),
        ];
        let settings = settings.into_iter().filter(|(_, is_set, _)| *is_set);
        let settings: Vec<String> = settings
            .map(|(key, _, value)| format!("--set {key}={value}"))
            .collect();
        folder.ends(
            0,
            &format!("run sweep.toml {} --out {name}", settings.join(" ")),
        );
        assert!(panels_are_full(&folder, &name, &name) > 0, "{name}");
    }
}

#[test]
fn standing_figures_of_some_sets_stand_beside_those_of_all_and_show_the_slips_of_these() {
    let folder = Folder::new();
    folder.write(
        "sweep.toml",
        "name = \"s\"\n[model]\nN = 3\nNs = 4\nDelta = 1e-6\n[axes]\nV0 = [1e-5, 1e-4]\nfrequency = [40, 90]\n\
         [record]\nslips = 4\n",
    );
    folder.ends(0, "run sweep.toml --out r");
    let all = folder.contents("r/figures");
    folder.screens(
        "plot_where",
        [
            "plot r --where V0<5e-5 --format svg",
            "plot r --where V0<1e-9",
            "plot r --where no_column<1",
            "plot r --where V0<1 --with r",
        ],
    );
    let now = folder.contents("r/figures");
    assert!(all.iter().all(|(path, bytes)| now[path] == *bytes));
    let svg = |name: &str| {
        let bytes = now[Path::new(name)].clone().unwrap();
        String::from_utf8(bytes).unwrap()
    };
    let dots = |svg: &str| svg.matches("<circle").count() + svg.matches("stroke=\"none\"").count();
    let some = svg("tau-T-where.svg");
    let of_all = dots(&svg("tau-T.svg"));
    assert!(some.contains("where V0") && (1..of_all).contains(&dots(&some)));
}
