//! Jobs with several ranks on this machine. They need `mpirun` of the MPI library that the program was built with.

use std::path::Path;
use std::process::{Command, Output};

/// Runs a job with some ranks; `None` without `mpirun`.
fn job(ranks: u32, args: &[&str]) -> Option<Output> {
    let mut command = Command::new("mpirun");
    command.args(["-np", &ranks.to_string(), env!("CARGO_BIN_EXE_umbravox-mpi")]).args(args);
    // Open MPI refuses root and more ranks than cores unless it is told to.
    for name in
        ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"]
    {
        command.env(name, "1");
    }
    match command.output() {
        Ok(output) => Some(output),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            eprintln!("skipped: there is no mpirun");
            None
        }
        Err(e) => panic!("{e}"),
    }
}

const SCENE: [&str; 8] =
    ["phantom:struts:48", "--tf", "isosurface", "--shadow", "dsm:map=64", "--size", "64x60", "--json"];

#[test]
fn every_number_of_ranks_gives_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |ranks: u32| {
        let path = folder.path().join(format!("{ranks}.npy"));
        let output = job(ranks, &[&SCENE[..], &["-o", path.to_str().unwrap()]].concat())?;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let reports = String::from_utf8(output.stdout).unwrap();
        assert_eq!(reports.lines().count(), ranks as usize, "{reports}");
        std::fs::read(path).ok()
    };
    let Some(one) = picture(1) else { return };
    for ranks in [2, 4] {
        assert!(picture(ranks).unwrap() == one, "{ranks} ranks");
    }
}

#[test]
fn errors_name_the_rank_and_end_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    let path = path.to_str().unwrap();
    let Some(output) = job(2, &["gone.nii", "-o", path]) else { return };
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && text.contains("umbravox-mpi: rank "), "{text}");
    assert!(text.contains("gone.nii") && !Path::new(path).exists(), "{text}");
}
