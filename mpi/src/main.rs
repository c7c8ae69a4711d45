//! `umbravox-mpi`: draws one picture with the processes (ranks) of an MPI job.
//!
//! Each rank builds the shadow-map tiles and draws the picture rows of its share. Light rays and eye rays are those of a
//! single process, so that every number of ranks gives the same picture to the last bit. Ranks exchange the curve nodes
//! of their shares (`MPI_Allgatherv`) and send their rows to rank 0 (`MPI_Gatherv`).

mod exchange;
mod job;

use clap::Parser;
use exchange::Ranks;
use mpi::traits::Communicator as _;
use std::path::PathBuf;
use std::process::ExitCode;
use umbravox::open::SceneArgs;

/// Draw one picture with the processes (ranks) of an MPI job
#[derive(Debug, Parser)]
#[command(version)]
pub struct Args {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output picture: .png, .exr or .npy
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Count the cells that the light rays of each rank march through; takes longer
    #[arg(long)]
    pub count_work: bool,
}

/// Exit status of ranks that panicked.
const PANICKED: i32 = 101;

fn main() -> ExitCode {
    let Some((universe, _)) = mpi::initialize_with_threading(mpi::Threading::Funneled) else {
        eprintln!("umbravox-mpi: MPI cannot be initialized");
        return ExitCode::FAILURE;
    };
    let world = universe.world();
    let rank = world.rank();
    // A rank that ends alone would leave the others waiting.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        hook(panic);
        mpi::topology::SimpleCommunicator::world().abort(PANICKED);
    }));
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(e) => {
            if rank == 0 {
                let _ = e.print();
            }
            return ExitCode::from(e.exit_code() as u8);
        }
    };
    let ran = Ranks::new(&world).and_then(|ranks| job::run(&args, &ranks));
    if let Err(e) = ran {
        eprintln!("umbravox-mpi: rank {rank}: {e}");
        world.abort(i32::from(e.exit_status()));
    }
    ExitCode::SUCCESS
}
