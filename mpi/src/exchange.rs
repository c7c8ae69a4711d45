//! Exchange of data between the ranks of an MPI job.

use mpi::collective::CommunicatorCollectives as _;
use mpi::collective::Root as _;
use mpi::datatype::PartitionMut;
use mpi::topology::{Communicator as _, SimpleCommunicator};
use std::cell::Cell;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use umbravox::field::WorkShare;
use umbravox::{Error, Result};

/// Environment variables in which launchers give the number of ranks: Open MPI, MPICH with its relatives, and Slurm.
const LAUNCHED: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"];

/// Ranks of an MPI job.
pub struct Ranks<'a> {
    world: &'a SimpleCommunicator,
    /// Number of bytes that this rank has sent to others.
    sent_bytes: Cell<u64>,
}

impl<'a> Ranks<'a> {
    /// Takes all ranks of a job.
    ///
    /// # Errors
    /// The launcher has started another number of processes than MPI knows: it is of another MPI library.
    pub fn new(world: &'a SimpleCommunicator) -> Result<Self> {
        let known = world.size();
        let launched = LAUNCHED.iter().filter_map(|name| std::env::var(name).ok()?.parse::<i32>().ok());
        if let Some(launched) = launched.max().filter(|launched| *launched != known) {
            let why = format!("the launcher started {launched} processes, and MPI knows {known}");
            return Err(Error::input("cannot start", "ranks", why)
                .hint("mpirun (or srun --mpi=...) is of another MPI library than the one umbravox-mpi was built with"));
        }
        Ok(Self { world, sent_bytes: Cell::new(0) })
    }

    /// Returns the number of this rank.
    pub fn rank(&self) -> u32 {
        self.world.rank() as u32
    }

    /// Returns the number of ranks.
    pub fn count(&self) -> u32 {
        self.world.size() as u32
    }

    /// Returns the share of this rank in the work.
    pub fn share(&self) -> WorkShare {
        WorkShare::new(self.rank(), self.count()).unwrap_or(WorkShare::WHOLE)
    }

    /// Checks that all ranks have the same inputs, given as a text.
    ///
    /// # Errors
    /// A rank has other inputs than rank 0.
    pub fn check_same(&self, inputs: &str) -> Result<()> {
        let mut hasher = DefaultHasher::new();
        inputs.hash(&mut hasher);
        let digest = hasher.finish();
        let all = self.all_gather(&[digest as u32, (digest >> 32) as u32])?;
        match all.iter().position(|own| *own != all[0]) {
            None => Ok(()),
            Some(rank) => {
                let why = format!("rank {rank} has another volume or scene than rank 0");
                Err(Error::input("cannot share the work", "ranks", why)
                    .hint("--downsample without a size depends on the memory of each machine"))
            }
        }
    }

    /// Returns the number of bytes that this rank has sent to others.
    pub fn sent_bytes(&self) -> u64 {
        self.sent_bytes.get()
    }

    /// Returns the words of all ranks, in the order of ranks, to every rank.
    ///
    /// # Errors
    /// Together they exceed what MPI counts.
    pub fn all_gather(&self, words: &[u32]) -> Result<Vec<Vec<u32>>> {
        let counts = self.counts(words.len())?;
        let mut all = vec![0_u32; counts.iter().map(|n| *n as usize).sum()];
        let starts = starts(&counts);
        let mut parts = PartitionMut::new(&mut all[..], counts.clone(), starts);
        self.world.all_gather_varcount_into(words, &mut parts);
        self.add_sent(words.len() * 4 * (self.count() as usize - 1));
        Ok(split(&all, &counts))
    }

    /// Returns the values of all ranks, in the order of ranks, to rank 0; `None` to others.
    ///
    /// # Errors
    /// Together they exceed what MPI counts.
    pub fn gather<T: mpi::traits::Equivalence + Clone + Default>(
        &self,
        values: &[T],
    ) -> Result<Option<Vec<Vec<T>>>> {
        let counts = self.counts(values.len())?;
        let root = self.world.process_at_rank(0);
        if self.rank() != 0 {
            root.gather_varcount_into(values);
            self.add_sent(size_of_val(values));
            return Ok(None);
        }
        let mut all = vec![T::default(); counts.iter().map(|n| *n as usize).sum()];
        let mut parts = PartitionMut::new(&mut all[..], counts.clone(), starts(&counts));
        root.gather_varcount_into_root(values, &mut parts);
        drop(parts);
        Ok(Some(split(&all, &counts)))
    }

    /// Returns the number of items of each rank.
    fn counts(&self, own: usize) -> Result<Vec<i32>> {
        let mut counts = vec![0_u64; self.count() as usize];
        self.world.all_gather_into(&(own as u64), &mut counts[..]);
        self.add_sent(8 * (self.count() as usize - 1));
        let all: u64 = counts.iter().sum();
        if i32::try_from(all).is_err() {
            let why = format!("{all} numbers in one exchange are more than MPI counts");
            return Err(Error::runtime("cannot exchange", "shares", why));
        }
        Ok(counts.into_iter().map(|n| n as i32).collect())
    }

    fn add_sent(&self, bytes: usize) {
        self.sent_bytes.set(self.sent_bytes.get() + bytes as u64);
    }
}

/// Returns the place of the first item of each rank.
fn starts(counts: &[i32]) -> Vec<i32> {
    let sums = counts.iter().scan(0, |sum, n| {
        let start = *sum;
        *sum += n;
        Some(start)
    });
    sums.collect()
}

fn split<T: Clone>(all: &[T], counts: &[i32]) -> Vec<Vec<T>> {
    let mut rest = all;
    let mut take = |count: &i32| {
        let (own, others) = rest.split_at(*count as usize);
        rest = others;
        own.to_vec()
    };
    counts.iter().map(&mut take).collect()
}
