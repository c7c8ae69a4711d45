//! Commands on the pages of the documentation. The program accepts its own command lines. Targets of `make`, scripts,
//! packages, features and files of the repository that other commands name exist.

use crate::readme::{blocks, pages};
use clap::Parser;
use clap::error::ErrorKind;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use umbravox::open::SceneArgs;
use umbravox::transfer::presets::PRESETS;

/// Values of shell variables and of placeholders of GNU parallel.
const VALUES: [(&str, &str); 5] = [
    ("$METHODS", "rays"),
    ("{1}", "rays"),
    ("{2}", "1"),
    ("$SLURM_ARRAY_TASK_ID", "1"),
    ("$SLURM_ARRAY_TASK_COUNT", "16"),
];
/// Programs of other projects. Their flags are not checked.
const OTHERS: [&str; 12] = [
    "apptainer",
    "apt-get",
    "docker",
    "ffmpeg",
    "install",
    "maturin",
    "mitsuba",
    "rattler-build",
    "sbatch",
    "update-desktop-database",
    "update-mime-database",
    "mdbook",
];
/// Flags of cargo, `umbravox-mpi`, `scripts/setup.sh` and programs of other projects that the prose names.
const OTHER_FLAGS: [&str; 8] = [
    "--count-work",
    "--no-default-features",
    "--requeue",
    "--retries",
    "--sshloginfile",
    "--tests",
    "--validate",
    "--wd",
];
/// Folders of the repository. A word that begins with one is a path.
const FOLDERS: [&str; 11] = [
    ".ci/",
    "benches/",
    "data/",
    "docs/",
    "examples/",
    "packaging/",
    "python/",
    "scripts/",
    "shaders/",
    "src/",
    "tests/",
];

/// Flags of `umbravox-mpi`, which this test program does not link: those of `mpi/src/main.rs`.
#[derive(Parser)]
struct Mpi {
    #[command(flatten)]
    _scene: SceneArgs,
    #[arg(short, long)]
    _output: PathBuf,
    #[arg(long)]
    _count_work: bool,
}

fn exists(path: &str) -> bool {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).exists()
}

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn require(condition: bool, why: impl FnOnce() -> String) -> Result<(), String> {
    condition.then_some(()).ok_or_else(why)
}

/// Splits a shell text into simple commands, and these into words without quotes. Newlines, lists, pipes and command
/// substitutions outside of quotes end a command.
fn simple_commands(text: &str) -> Vec<Vec<String>> {
    let mut commands = vec![vec![String::new()]];
    let mut quote = None;
    let text = text.replace("\\\n", " ");
    let mut characters = text.chars().peekable();
    while let Some(c) = characters.next() {
        let words = commands.last_mut().unwrap();
        let word = words.last_mut().unwrap();
        match c {
            _ if quote == Some(c) => quote = None,
            _ if quote.is_some() => word.push(c),
            '"' | '\'' => quote = Some(c),
            '#' if word.is_empty() => while characters.next_if(|c| *c != '\n').is_some() {},
            '\n' | '|' | '&' | ';' | '(' | ')' => commands.push(vec![String::new()]),
            ' ' => words.push(String::new()),
            _ => word.push(c),
        }
    }
    for words in &mut commands {
        words.retain(|word| !word.is_empty());
        for word in words {
            VALUES.iter().for_each(|(name, value)| *word = word.replace(name, value));
        }
    }
    commands.retain(|words| !words.is_empty());
    commands
}

/// Words of a command behind the variables that it sets.
fn without_variables<'a, 'b>(words: &'a [&'b str]) -> &'a [&'b str] {
    let is_variable = |word: &str| {
        word.split_once('=').is_some_and(|(name, _)| {
            name.chars().all(|c| c == '_' || c.is_ascii_alphanumeric()) && !name.is_empty()
        })
    };
    &words[words.iter().take_while(|word| is_variable(word)).count()..]
}

/// Checks a command line of the program, with the methods and the preset that it names.
fn check_own(arguments: &[&str]) -> Result<(), (ErrorKind, String)> {
    let line = std::iter::once("umbravox").chain(arguments.iter().copied());
    let parsed = umbravox::cli::command().try_get_matches_from(line);
    let matches = parsed.map_err(|e| (e.kind(), e.to_string()))?;
    let Some((_, flags)) = matches.subcommand() else { return Ok(()) };
    let invalid = |why: String| (ErrorKind::InvalidValue, why);
    if let Ok(Some(methods)) = flags.try_get_one::<String>("methods") {
        umbravox::shadow::parse_list(methods).map_err(|e| invalid(e.to_string()))?;
    }
    if let Ok(Some(tf)) = flags.try_get_one::<String>("tf") {
        let is_known = tf.contains('.') || PRESETS.iter().any(|preset| preset.name == tf);
        require(is_known, || format!("--tf {tf} is neither a file nor a preset")).map_err(invalid)?;
    }
    Ok(())
}

fn check_make(arguments: &[&str]) -> Result<(), String> {
    let makefile = read("Makefile");
    for word in arguments {
        let found = match word.split_once('=') {
            Some(("RESULTS", folder)) => exists(&format!("docs/results/{folder}")),
            Some((variable, _)) => makefile.contains(&format!("$({variable})")),
            None => makefile.lines().any(|line| line.starts_with(&format!("{word}:"))),
        };
        require(found, || format!("`make` has no {word}"))?;
    }
    Ok(())
}

fn check_cargo(arguments: &[&str]) -> Result<(), String> {
    let end = arguments.iter().position(|word| *word == "--").unwrap_or(arguments.len());
    let (own, rest) = (&arguments[..end], arguments.get(end + 1..).unwrap_or_default());
    let has_line = |file: &str, start: &str| read(file).lines().any(|line| line.starts_with(start));
    for pair in own.windows(2) {
        let found = match *pair {
            ["--test", name] => exists(&format!("tests/{name}.rs")) || exists(&format!("tests/{name}")),
            ["--example", name] => exists(&format!("examples/{name}.rs")),
            ["--bench", name] => exists(&format!("benches/{name}.rs")),
            ["--features", name] => has_line("Cargo.toml", &format!("{name} = ")),
            ["-p", name] => {
                let line = format!("name = \"{name}\"");
                ["Cargo.toml", "python/Cargo.toml", "mpi/Cargo.toml"].iter().any(|file| has_line(file, &line))
            }
            _ => true,
        };
        require(found, || format!("`cargo` finds no {}", pair[1]))?;
    }
    match *own {
        // A filter that no test has would run nothing, without an error.
        ["test", "--test", program, filter] => {
            let module = format!("tests/{program}/{filter}");
            require(exists(&module) || exists(&format!("{module}.rs")), || format!("no tests {filter}"))
        }
        ["test", "--lib", filter] => {
            let module = format!("src/{}", filter.trim_end_matches("::"));
            require(exists(&module) || exists(&format!("{module}.rs")), || format!("no tests {filter}"))
        }
        ["run", ..] if !own.contains(&"--example") => check_own(rest).map_err(|(_, why)| why),
        _ => Ok(()),
    }
}

fn check_pip(packages: &[&str]) -> Result<(), String> {
    let project = read("pyproject.toml");
    for package in packages {
        let found = match package.strip_prefix(".[").and_then(|extra| extra.strip_suffix(']')) {
            Some(extra) => project.contains(&format!("\n{extra} = [")),
            None => *package == "." || project.contains(&format!("\"{package}")),
        };
        require(found, || format!("pyproject.toml does not name {package}"))?;
    }
    Ok(())
}

/// Checks a simple command.
fn check(words: &[&str]) -> Result<(), String> {
    let words = without_variables(words);
    let Some((program, arguments)) = words.split_first() else { return Ok(()) };
    for word in words.iter().filter(|word| FOLDERS.iter().any(|folder| word.starts_with(folder))) {
        require(exists(word), || format!("there is no {word}"))?;
    }
    match (program.trim_start_matches("target/release/"), arguments) {
        ("exec" | "srun" | "mpirun" | "parallel", _) | ("docker" | "apptainer", ["run", ..]) => {
            // The program behind the flags of its launcher.
            let own = arguments.iter().position(|word| word.contains("umbravox")).ok_or("no program")?;
            let end = arguments.iter().position(|word| *word == ":::").unwrap_or(arguments.len());
            check(&arguments[own..end])
        }
        ("umbravox" | "umbravox.sif", _) | ("python", ["-m", "umbravox", ..]) => {
            let own = if *program == "python" { &arguments[2..] } else { arguments };
            check_own(own).map_err(|(_, why)| why)
        }
        ("umbravox-mpi", _) => Mpi::try_parse_from(words).map(|_| ()).map_err(|e| e.to_string()),
        ("make", _) => check_make(arguments),
        ("cargo", _) => check_cargo(arguments),
        ("pip", ["install", packages @ ..]) => check_pip(packages),
        ("sbatch", [.., "--wrap", text]) => check_text(text).map(|_| ()),
        (other, _) if OTHERS.contains(&other) => Ok(()),
        (script, _) => {
            require(exists(script), || format!("there is no program or script {script}"))?;
            let unknown = arguments.iter().find(|word| !read(script).contains(*word));
            require(unknown.is_none(), || format!("{script} does not name {}", unknown.unwrap()))
        }
    }
}

/// Checks all commands of a shell text and returns their number.
fn check_text(text: &str) -> Result<usize, String> {
    let commands = simple_commands(text);
    for command in &commands {
        let words: Vec<&str> = command.iter().map(String::as_str).collect();
        check(&words).map_err(|why| format!("{}\n{why}", words.join(" ")))?;
    }
    Ok(commands.len())
}

fn assert_none(offenders: &[String]) {
    assert!(offenders.is_empty(), "{} wrong commands:\n{}", offenders.len(), offenders.join("\n"));
}

#[test]
fn every_command_shown_is_accepted() {
    let (mut count, mut offenders) = (0, Vec::new());
    let mut check_all = |place: &str, text: &str| match check_text(text) {
        Ok(commands) => count += commands,
        Err(why) => offenders.push(format!("{place}: {why}")),
    };
    for (path, page) in pages() {
        for (_, text) in blocks(&page).filter(|(language, _)| ["", "sh"].contains(language)) {
            check_all(&path.display().to_string(), text);
        }
    }
    // The comments at the top of recipes for containers have commands too.
    for recipe in ["packaging/Dockerfile", "packaging/umbravox.def"] {
        read(recipe)
            .lines()
            .filter_map(|line| line.strip_prefix("#   "))
            .for_each(|line| check_all(recipe, line));
    }
    assert_none(&offenders);
    assert!(count > 150, "only {count} commands found");
}

/// Inline code of a page.
fn inline_code(page: &str) -> Vec<String> {
    let prose = page.split("```").step_by(2).flat_map(|text| text.split("\n\n"));
    let spans = prose.flat_map(|paragraph| paragraph.split('`').skip(1).step_by(2));
    spans.map(|span| span.split_whitespace().collect::<Vec<_>>().join(" ").replace("\\|", "|")).collect()
}

/// Long flags of a command and its subcommands.
fn flags_of(command: &clap::Command) -> BTreeSet<String> {
    let own = command.get_arguments().filter_map(|flag| Some(format!("--{}", flag.get_long()?)));
    own.chain(command.get_subcommands().flat_map(flags_of)).collect()
}

/// Checks inline code: commands as those of code blocks, and flags alone. Command lines of the program may have placeholders
/// in capital letters, and may lack arguments; then their flags have to exist.
fn check_inline(span: &str, program: &clap::Command) -> Result<(), String> {
    let words: Vec<&str> = span.split(' ').collect();
    let words = without_variables(&words);
    let is_placeholder = |text: &str| text.contains(|c: char| c.is_ascii_uppercase() || "[*<{".contains(c));
    let own = match words {
        ["umbravox", own @ ..] if !own.is_empty() => match check_own(own) {
            Ok(()) | Err((ErrorKind::MissingRequiredArgument | ErrorKind::DisplayHelp, _)) => return Ok(()),
            Err((ErrorKind::InvalidSubcommand, why)) if !is_placeholder(own[0]) => return Err(why),
            Err((_, why)) if !is_placeholder(span) => return Err(why),
            Err(_) => own,
        },
        ["make" | "cargo" | "pip", _, ..] => return check_text(span).map(|_| ()),
        [path, ..] if FOLDERS.iter().any(|folder| path.starts_with(folder)) => {
            let is_literal = !is_placeholder(&path.replace("README", ""));
            return if is_literal { check_text(span).map(|_| ()) } else { Ok(()) };
        }
        _ => words,
    };
    let command = own.first().and_then(|name| program.find_subcommand(name)).unwrap_or(program);
    let flags = flags_of(command);
    for word in own.iter().filter(|word| word.starts_with("--") && word.len() > 2) {
        let flag: String = word.chars().take_while(|c| *c == '-' || c.is_ascii_alphanumeric()).collect();
        let is_known = flags.contains(&flag) || OTHER_FLAGS.contains(&flag.as_str());
        require(is_known, || format!("there is no flag {flag}"))?;
    }
    Ok(())
}

#[test]
fn inline_code_names_commands_flags_and_files_that_exist() {
    let mut program = umbravox::cli::command();
    program.build();
    let mut offenders = Vec::new();
    // The changelog names what older versions had.
    for (path, page) in pages().into_iter().filter(|(path, _)| !path.ends_with("CHANGELOG.md")) {
        for span in inline_code(&page) {
            if let Err(why) = check_inline(&span, &program) {
                offenders.push(format!("{}: `{span}`: {why}", path.display()));
            }
        }
    }
    assert_none(&offenders);
    for (span, why) in [
        ("umbravox nothing FILE", "nothing"),
        ("umbravox render VOLUME --nothing", "--nothing"),
        ("render --methods LIST", "--methods"),
        ("--nothing N", "--nothing"),
        ("make nothing", "nothing"),
        ("docs/nothing.md", "there is no docs/nothing.md"),
    ] {
        let found = check_inline(span, &program).expect_err(span);
        assert!(found.contains(why), "{span}: {found}");
    }
}

#[test]
fn wrong_commands_are_found() {
    for (text, why) in [
        ("make nothing", "`make` has no nothing"),
        ("make results RESULTS=nothing", "RESULTS=nothing"),
        ("A=1 cargo test --test it nothing", "no tests nothing"),
        ("cargo run --example nothing", "finds no nothing"),
        ("pip install '.[nothing]'", ".[nothing]"),
        ("scripts/nothing.sh", "there is no scripts/nothing.sh"),
        ("scripts/setup.sh --nothing", "does not name --nothing"),
        ("nothing -x", "no program or script nothing"),
        ("umbravox render --scene examples/nothing.toml -o x.png", "there is no examples/nothing.toml"),
        ("cat x | umbravox render - --nothing -o x.png", "no program or script cat"),
        ("A=1 umbravox render --nothing", "--nothing"),
        ("exec umbravox compare --nothing", "--nothing"),
        ("mpirun -np 4 umbravox-mpi --nothing", "--nothing"),
        ("sbatch --wrap \"umbravox merge a --nothing\"", "--nothing"),
        ("umbravox render --tf nothing -o x.png", "neither a file nor a preset"),
        ("umbravox compare --methods \"dsm;nothing\" -o x", "nothing"),
        ("umbravox compare -o x --methods dsm;osm", "no program or script osm"),
    ] {
        let found = check_text(text).expect_err(text);
        assert!(found.contains(why), "{text}: {found}");
    }
}
