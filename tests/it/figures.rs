//! Which figures a sweep gets: those whose data it has, and no others.

use crate::program::Folder;

/// Always there under modulation.
const MODULATED: [&str; 2] = ["phi-eta", "tau-T"];

#[test]
fn each_sweep_gets_the_figures_that_fit_it() {
    let table: &[(&str, &[&str])] = &[
        ("Delta = { log = [1e-7, 2e-6], points = 8 }\nfrequency = { log = [20, 400], points = 8 }", &["locking-map"]),
        ("Delta = [0, 1e-6]\nfrequency = { linear = [20, 400], points = 24 }", &["staircase"]),
        ("Delta = { linear = [0, 2e-6], points = 8 }\nfrequency = { linear = [20, 400], points = 7 }", &[]),
        ("Delta = [0, 1e-6]\nfrequency = [90]\ntau_r = [1e-3, 2e-3, 5e-3]", &["dependence"]),
        (
            "Delta = [0, 1e-6]\nfrequency = [90]\nbreak_on = [\"magnitude\", \"tension\"]",
            &["dependence", "tau-histograms"],
        ),
        ("Delta = [0, 5e-7, 1e-6, 2e-6, 4e-6]\nfrequency = [90]", &["friction"]),
        ("Delta = [0, 1e-6]\nfrequency = [90]", &["tau-histograms"]),
    ];
    let folder = Folder::new();
    for (index, (axes, expected)) in table.iter().enumerate() {
        let text = format!("name = \"s\"\n[model]\nN = 3\nNs = 4\n[axes]\n{axes}\n[record]\nslips = 4\n");
        folder.write("sweep.toml", &text);
        folder.ends(0, &format!("run sweep.toml --out r{index}"));
        let figures = folder.contents(&format!("r{index}/figures"));
        let mut names: Vec<String> = MODULATED.iter().chain(*expected).map(|name| (*name).to_owned()).collect();
        names.sort();
        for extension in ["png", "svg"] {
            let drawn = figures.keys().filter(|path| path.extension().unwrap() == extension);
            let mut drawn: Vec<String> =
                drawn.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
            drawn.sort();
            assert_eq!(drawn, names, "{extension}: {axes}");
        }
    }
}
