//! A schedule: processes do one operation on the disk at a time, in an order that a seed decides. One of them may be
//! killed at an operation, or suspended.

use crate::results::workers::tests::lose;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeSet;
use std::io;
use std::sync::{Condvar, Mutex, MutexGuard};

struct State {
    random: ChaCha8Rng,
    /// How often each process is chosen, compared with the others: some are slow.
    weights: Vec<u64>,
    running: BTreeSet<usize>,
    waiting: BTreeSet<usize>,
    turn: Option<usize>,
    /// Who is killed, and how many operations it does before.
    kill: Option<(usize, u64)>,
    killed: BTreeSet<usize>,
    /// Who is suspended until all others have ended, and how many operations it does before.
    freeze: Option<(usize, u64)>,
    frozen: Option<usize>,
    log: Vec<(usize, &'static str)>,
}

impl State {
    /// Gives the next turn, once every process that runs waits for one.
    fn choose(&mut self) {
        if self.turn.is_some() || self.waiting.is_empty() || self.waiting != self.running {
            return;
        }
        let is_alone = self.running.len() == 1;
        self.frozen.take_if(|_| is_alone);
        let awake = || {
            self.waiting
                .iter()
                .copied()
                .filter(|process| Some(*process) != self.frozen)
        };
        let total: u64 = awake().map(|process| self.weights[process]).sum();
        let mut left = self.random.next_u64() % total;
        self.turn = awake().find(|&process| {
            let weight = self.weights[process];
            let is_it = left < weight;
            left = left.saturating_sub(weight);
            is_it
        });
    }
}

pub fn random_index(random: &mut ChaCha8Rng, count: usize) -> usize {
    usize::try_from(random.next_u64() % count as u64).unwrap()
}

pub struct Schedule {
    state: Mutex<State>,
    turned: Condvar,
}

impl Schedule {
    /// Schedules `processes`. With `kill_before`, one of them is killed at one of its first operations, this number at
    /// most; with `freeze_before`, the first is suspended likewise, for so long that others take it for dead.
    pub fn new(
        seed: u64,
        processes: usize,
        kill_before: Option<u64>,
        freeze_before: Option<u64>,
    ) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let weights = (0..processes)
            .map(|_| 1 << (random.next_u64() % 8))
            .collect();
        let kill = kill_before.map(|below| {
            (
                random_index(&mut random, processes),
                random.next_u64() % below,
            )
        });
        let freeze = freeze_before.map(|below| (0, random.next_u64() % below));
        let state = State {
            random,
            weights,
            running: (0..processes).collect(),
            waiting: BTreeSet::new(),
            turn: None,
            kill,
            killed: BTreeSet::new(),
            freeze,
            frozen: None,
            log: Vec::new(),
        };
        Self {
            state: Mutex::new(state),
            turned: Condvar::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap()
    }

    /// Waits until a process may do its next operation, and says which. An error if it was killed.
    pub fn turn(&self, process: usize, action: &'static str) -> io::Result<()> {
        self.outside(process)?;
        let mut state = self.state();
        if let Some((_, left)) = state
            .freeze
            .as_mut()
            .filter(|(victim, _)| *victim == process)
        {
            if *left == 0 {
                (state.freeze, state.frozen) = (None, Some(process));
                lose(std::thread::current().id());
            } else {
                *left -= 1;
            }
        }
        state.waiting.insert(process);
        state.choose();
        self.turned.notify_all();
        let mut state = self
            .turned
            .wait_while(state, |state| state.turn != Some(process))
            .unwrap();
        state.turn = None;
        state.waiting.remove(&process);
        state.log.push((process, action));
        if let Some((_, left)) = state.kill.as_mut().filter(|(victim, _)| *victim == process) {
            if *left == 0 {
                state.kill = None;
                state.killed.insert(process);
            } else {
                *left -= 1;
            }
        }
        drop(state);
        self.outside(process)
    }

    /// Whether a process may still do something outside its turns.
    pub fn outside(&self, process: usize) -> io::Result<()> {
        if self.state().killed.contains(&process) {
            Err(io::Error::other("the process was killed"))
        } else {
            Ok(())
        }
    }

    /// A process has ended; says whether it was killed.
    pub fn end(&self, process: usize) -> bool {
        let mut state = self.state();
        state.running.remove(&process);
        state.choose();
        self.turned.notify_all();
        state.killed.contains(&process)
    }

    pub fn now(&self) -> u64 {
        self.state().log.len() as u64
    }

    pub fn log(self) -> Vec<(usize, &'static str)> {
        self.state.into_inner().unwrap().log
    }
}
