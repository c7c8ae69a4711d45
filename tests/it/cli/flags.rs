//! Command line: help, flags and their values.

use crate::program::{Printed, refused, succeed, umbravox};

fn stdout(args: &[&str]) -> String {
    let Printed { stdout, stderr } = succeed(&std::env::temp_dir(), args);
    assert!(stderr.is_empty(), "{args:?} wrote to stderr");
    stdout
}

#[test]
fn help_names_every_command_and_the_version_is_the_crates() {
    let help = stdout(&["--help"]);
    let all = umbravox::cli::command();
    for command in all.get_subcommands() {
        let (name, about) =
            (command.get_name(), command.get_about().expect("it says what it does").to_string());
        let words = |s: &str| s.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words(&help).contains(&format!("{name} {about}")), "{name} is missing:\n{help}");
        assert!(words(&stdout(&[name, "-h"])).starts_with(&about), "{name}");
    }
    assert!(all.get_subcommands().count() >= 8);
    assert_eq!(stdout(&["--version"]), format!("umbravox {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn help_of_the_drawing_commands_shows_every_flag_and_its_default() {
    for command in ["render", "probe", "compare"] {
        let help = stdout(&[command, "--help"]).split_whitespace().collect::<Vec<_>>().join(" ");
        for (flag, default) in [
            ("--tf", "ct for a volume in HU"),
            ("--shadow", "dsm"),
            ("--size", "512x512"),
            ("--eye", "frames the visible part"),
            ("--target", "centre of the framed part"),
            ("--up", "0,0,1"),
            ("--fov", "40"),
            ("--light", "dir:0.5,0.5,0.7071"),
            ("--ambient", "0.1"),
            ("--shading", "none"),
            ("--background", "#000000"),
            ("--step", "0.5"),
            ("--skip", "bricks"),
        ] {
            let at = help.find(&format!("{flag} <")).unwrap_or_else(|| panic!("{command}: no {flag}"));
            let after = &help[at..];
            let shown = after.find("[default: ").map(|d| &after[d + 10..]);
            assert!(
                shown.is_some_and(|d| d.starts_with(default)),
                "{command} {flag}: {default} is not shown"
            );
        }
        for flag in [
            "--scene",
            "--explain",
            "--json",
            "--adapter",
            "--verbose",
            "--raw",
            "--spacing",
            "--offset",
            "--frame",
            "--resolution",
            "--kernel",
            "--thickness",
            "--opacity-scale",
            "--units",
        ] {
            assert!(help.contains(flag), "{command}: no {flag}");
        }
        for preset in umbravox::transfer::presets::PRESETS {
            assert!(help.contains(preset.name), "{command}: preset {}", preset.name);
            assert!(stdout(&["tf", "list"]).contains(preset.about), "{}", preset.name);
        }
        for method in umbravox::shadow::METHODS {
            assert!(help.contains(method.name), "{command}: method {}", method.name);
        }
    }
}

#[test]
fn help_of_the_drawing_commands_fits_few_screens() {
    for (command, most) in [("render", 160), ("view", 135), ("compare", 180), ("export", 145), ("probe", 155)]
    {
        let lines = stdout(&[command, "--help"]).lines().count();
        assert!(lines <= most, "{command}: {lines} lines");
        assert_eq!(stdout(&[command, "-h"]), stdout(&[command, "--help"]), "{command}");
    }
}

#[test]
fn help_of_phantom_names_them_with_their_sizes() {
    let help = stdout(&["phantom", "--help"]);
    for phantom in umbravox::phantom::Phantom::ALL {
        assert!(help.contains(&format!("  {} ", phantom.name())) && help.contains(phantom.description()));
        assert!(help.contains(&format!("[default size: {}]", phantom.default_size())));
    }
    for set in umbravox::strands::StrandSet::ALL {
        assert!(help.contains(&format!("  {} ", set.name())) && help.contains(set.description()));
    }
}

#[test]
fn bad_command_lines_are_one_error_line_that_names_the_flag() {
    let dir = tempfile::tempdir().unwrap();
    for (args, place, why) in [
        (&[][..], "umbravox", "requires a subcommand"),
        (&["paint"], "paint", "unrecognized subcommand"),
        (&["info"], "VOLUME", "required"),
        (&["view", "gone.nii"], "gone.nii", "no such file"),
        (&["compare", "-o", "out", "--difference-max", "0"], "--difference-max", "from 1e-6 to 1"),
        (&["merge", "a", "-o", "out", "--difference-max", "wide"], "--difference-max", "from 1e-6 to 1"),
        (&["render", "phantom:slab:8"], "--output", "required"),
        (&["render", "phantom:slab:8", "-o", "a.png", "--bogus"], "--bogus", "unexpected argument"),
        (&["render", "phantom:slab:8", "again", "-o", "a.png"], "again", "unexpected argument"),
        (&["render", "-o", "a.png", "--fov"], "--fov", "a value is required"),
        (&["render", "-o", "a.png", "--fov", "0"], "--fov", "from 0.001 to 179.9"),
        (&["render", "-o", "a.png", "--fov", "180"], "--fov", "from 0.001 to 179.9"),
        (&["render", "-o", "a.png", "--fov", "-40"], "--fov", "'-40'"),
        (&["render", "-o", "a.png", "--fov", "nan"], "--fov", "finite"),
        (&["render", "-o", "a.png", "--fov", "wide"], "--fov", "`wide` is not a number"),
        (&["render", "-o", "a.png", "--size", "0x10"], "--size", "WxH"),
        (&["render", "-o", "a.png", "--size", "16385x10"], "--size", "16384"),
        (&["render", "-o", "a.png", "--size", "512x"], "--size", "WxH"),
        (&["render", "-o", "a.png", "--ambient", "1.5"], "--ambient", "from 0 to 1"),
        (&["render", "-o", "a.png", "--ambient", "-0.1"], "--ambient", "from 0 to 1"),
        (&["render", "-o", "a.png", "--step", "0"], "--step", "from 0.01 to 8"),
        (&["render", "-o", "a.png", "--step", "-1"], "--step", "from 0.01 to 8"),
        (&["render", "-o", "a.png", "--step", "9"], "--step", "from 0.01 to 8"),
        (&["render", "-o", "a.png", "--eye", "1,2"], "--eye", "x,y,z"),
        (&["render", "-o", "a.png", "--eye", "1,2,nan"], "--eye", "finite"),
        (&["render", "-o", "a.png", "--eye", "1,2,1e300"], "--eye", "beyond"),
        (&["render", "-o", "a.png", "--up", "0,0,0"], "--up", "length is 0"),
        (&["render", "-o", "a.png", "--light", "dir:0,0,0"], "--light", "length is 0"),
        (&["render", "-o", "a.png", "--light", "sun"], "--light", "dir:x,y,z"),
        (&["render", "-o", "a.png", "--light", "point:1,2"], "--light", "x,y,z"),
        (&["render", "-o", "a.png", "--background", "blackish"], "--background", "#rrggbb"),
        (&["render", "-o", "a.png", "--shading", "phong"], "--shading", "'phong'"),
        (
            &["render", "phantom:thorax", "-o", "a.png", "--shading", "kajiya-kay"],
            "--shading",
            "phantom:thorax is not of strands",
        ),
        (
            &["compare", "phantom:slab:8", "-o", "d", "--shading", "kajiya-kay"],
            "--shading",
            "phantom:slab:8 is not of strands",
        ),
        (&["render", "-o", "a.png", "--skip", "all"], "--skip", "'all'"),
        (&["render", "-o", "a.png", "--raw", "4x4:u8"], "--raw", "4x4"),
        (&["render", "-o", "a.png", "--raw", "4x4x4:u9"], "--raw", "u9"),
        (&["render", "-o", "a.png", "--spacing", "1,1,-1"], "--spacing", "greater than 0"),
        (&["render", "-o", "a.png", "--offset", "-1"], "--offset", "'-1'"),
        (&["render", "-o", "a.png", "--frame", "1.5"], "--frame", "'1.5'"),
        (&["probe", "phantom:slab:8"], "--rays", "required"),
        (&["probe", "--rays", "a", "--points", "b"], "--rays", "cannot be used with"),
        (&["compare", "-o", "d", "--repeats", "0"], "--repeats", "1..=1000"),
        (&["compare", "phantom:slab:8", "-o", "d", "--methods", "none;;rays"], "--methods", "NAME"),
        (
            &["compare", "--scene", "-", "--scene", "-", "-o", "d"],
            "--scene -",
            "standard input holds one scene",
        ),
        (&["compare", "phantom:slab:8", "-o", "d", "--methods", "dsm:0.02"], "--methods", "no key before it"),
        (&["phantom", "sfere", "-o", "a.nii"], "phantom:sfere", "no phantom"),
        (&["phantom", "sphere:0", "-o", "a.nii"], "phantom:sphere:0", "size"),
        (&["info", "phantom:"], "phantom:", "no phantom"),
    ] {
        let error = refused(dir.path(), args);
        let (start, rest) = error.split_once(" (").expect("WHAT (WHERE): WHY");
        let (at, reason) = rest.split_once("): ").expect("WHAT (WHERE): WHY");
        assert!(start.len() > 7 && at.contains(place), "{args:?}: {error}");
        assert!(reason.contains(why), "{args:?}: {error}");
    }
}

#[test]
fn cameras_that_look_nowhere_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let camera = |flags: &[&str]| {
        refused(dir.path(), &[&["render", "phantom:slab:8", "--tf", "bone", "-o", "a.png"], flags].concat())
    };
    assert!(camera(&["--eye", "1,2,3", "--target", "1,2,3"]).contains("eye is at the target"));
    assert!(camera(&["--eye", "1e8,0,0", "--target", "1e8,0.001,0"]).contains("eye is at the target"));
    assert!(camera(&["--eye", "0,0,500", "--target", "0,0,0"]).contains("(--up)"));
    assert!(camera(&["--eye", "-10,20,-30", "--target", "0,0,0", "--up=1,-2,3"]).contains("(--up)"));
}

#[test]
fn a_misspelling_gets_a_hint() {
    let output = umbravox(&std::env::temp_dir(), &["render", "--ey", "1,2,3"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("hint: did you mean `--eye`?"));
    let output = umbravox(&std::env::temp_dir(), &["rendre"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("hint: did you mean `render`?"));
}

#[test]
fn hints_name_what_was_meant() {
    let dir = tempfile::tempdir().unwrap();
    for (line, hint) in [
        (&["compare", "phantom:slab:8", "--methods", "dsm,osm", "-o", "d"][..], "`;` separates them"),
        (&["compare", "phantom:slab:8", "-tf", "bone", "-o", "d"], "did you mean `--tf`?"),
        (&["render", "phantom:slab:8", "-view", "A", "-o", "a.png"], "did you mean `--view`?"),
        (&["render", "phantom:slab:8", "-size=8x8", "-o", "a.png"], "did you mean `--size`?"),
        (&["render", "phantom:slab:8", "--tf", "Bone", "-o", "a.png"], "did you mean `bone`?"),
        (&["render", "phantom:slab:8", "-x", "-o", "a.png"], "see `umbravox render --help`"),
        (&["render", "phantom:slab:8", "--camera", "1", "-o", "a.png"], "see `umbravox render --help`"),
        (&["render", "phantom:slab:8", "--shading", "lamber", "-o", "a.png"], "did you mean `lambert`?"),
    ] {
        refused(dir.path(), line);
        let stderr = String::from_utf8(umbravox(dir.path(), line).stderr).unwrap();
        assert!(stderr.contains("hint: ") && stderr.contains(hint), "{line:?}: {stderr}");
    }
}

#[test]
fn methods_are_listed_with_their_settings() {
    let dir = tempfile::tempdir().unwrap();
    let all = stdout(&["methods"]);
    assert_eq!(stdout(&["help", "methods"]), all);
    for method in umbravox::shadow::METHODS {
        assert!(all.lines().any(|line| line.starts_with(&format!("{} ", method.name))), "{}", method.name);
        let own = stdout(&["methods", method.name]);
        assert!(
            method.keys.iter().all(|key| own.contains(&format!("\n{}={}", key.name, key.values()))),
            "{own}"
        );
    }
    assert!(refused(dir.path(), &["methods", "esm"]).contains("there are none, rays, dsm, osm"));
}

#[test]
fn completions_and_man_pages_are_made() {
    let dir = tempfile::tempdir().unwrap();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = stdout(&["completions", shell]);
        assert!(script.contains("umbravox") && script.contains("opacity-scale"), "{shell}");
    }
    succeed(dir.path(), &["completions", "--man", "."]);
    let page = std::fs::read_to_string(dir.path().join("umbravox-render.1")).unwrap();
    assert!(page.contains(".TH") && page.contains("opacity\\-scale"), "{page}");
    assert!(refused(dir.path(), &["completions"]).contains("required"));
    assert!(refused(dir.path(), &["completions", "--man", "nowhere"]).contains("not a folder"));
}

#[test]
fn negative_vectors_are_values_with_and_without_the_equals_sign() {
    let dir = tempfile::tempdir().unwrap();
    // Both must get as far as the transfer function, which is looked for after the flags are read.
    for eye in [&["--eye", "-1,2,3"][..], &["--eye=-1,2,3"]] {
        let error = refused(dir.path(), &[&["render", "-o", "a.png", "--tf", "no-such"], eye].concat());
        assert!(error.contains("--tf no-such"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    use std::process::{Command, Stdio};
    let mut child = Command::new(env!("CARGO_BIN_EXE_umbravox"))
        .args(["render", "--help"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[test]
fn lights_that_make_no_sense_are_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let render = |lights: &[&str]| {
        let flags = lights.iter().flat_map(|light| ["--light", light]);
        let line = ["render", "phantom:slab:8", "-o", "a.png"].into_iter().chain(flags).collect::<Vec<_>>();
        refused(dir.path(), &line)
    };
    for (light, why) in [
        ("dir:0,0,1,intensity=-1", "0 to"),
        ("dir:0,0,1,intensity=nan", "finite"),
        ("dir:0,0,1,intensity=1,intensity=2", "twice"),
        ("point:0,0,1,color=reddish", "#rrggbb"),
        ("point:0,0,1,size=2", "no key"),
    ] {
        let said = render(&["dir:0,0,1", light]);
        assert!(said.contains("--light") && said.contains(why), "{light}: {said}");
    }
    let said = render(&["dir:0,0,1"; 17]);
    assert!(said.contains("too many lights") && said.contains("17") && said.contains("16"), "{said}");
    std::fs::write(dir.path().join("two.toml"), "light = ['dir:0,0,1', 'dir:0,1,0,intensity=2']").unwrap();
    std::fs::write(dir.path().join("none.toml"), "light = []").unwrap();
    std::fs::write(dir.path().join("mixed.toml"), "light = ['dir:0,0,1', 2]").unwrap();
    std::fs::write(dir.path().join("p.txt"), "0 0 0").unwrap();
    for scene in ["none.toml", "mixed.toml"] {
        let said = refused(dir.path(), &["render", "--scene", scene, "-o", "a.png"]);
        assert!(said.contains("light"), "{said}");
    }
    for what in [["--points", "p.txt"], ["--rays", "p.txt"], ["--curve", "0,0,0"]] {
        let line = [&["probe", "phantom:slab:8", "--scene", "two.toml"], &what[..]].concat();
        let said = refused(dir.path(), &line);
        assert!(said.contains("--light") && said.contains("`probe` takes one"), "{said}");
    }
    let line = ["compare", "phantom:slab:8", "-o", "out", "--each-light", "--light", "dir:0,0,1"];
    assert!(refused(dir.path(), &line).contains("--each-light"));
}
