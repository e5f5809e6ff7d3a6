//! What ran, and for how long.

use anyhow::{Context, Result};
use std::time::Instant;

/// The steps of a chore, printed at its end.
#[derive(Default)]
pub struct Table(Vec<String>);

impl Table {
    /// Does a step; its failure names it.
    pub fn step(&mut self, name: &str, work: impl FnOnce() -> Result<()>) -> Result<()> {
        println!("== {name}");
        let start = Instant::now();
        work().with_context(|| name.to_string())?;
        self.0.push(format!(
            "passed  {name} ({:.0} s)",
            start.elapsed().as_secs_f64()
        ));
        Ok(())
    }

    /// Does two rows of steps side by side, on two threads: what each leaves idle of the machine the other
    /// can use. Both go to their end; a failure of the first is reported before one of the second.
    pub fn side_by_side(
        &mut self,
        first: impl FnOnce(&mut Self) -> Result<()> + Send,
        second: impl FnOnce(&mut Self) -> Result<()> + Send,
    ) -> Result<()> {
        let (mut one, mut other) = (Self::default(), Self::default());
        let outcomes = std::thread::scope(|scope| {
            let beside = scope.spawn(|| second(&mut other));
            let outcome = first(&mut one);
            let beside = beside.join();
            [
                outcome,
                beside.unwrap_or_else(|_| Err(anyhow::anyhow!("a chore panicked"))),
            ]
        });
        self.0.append(&mut one.0);
        self.0.append(&mut other.0);
        outcomes.into_iter().collect()
    }

    /// Red on a terminal that knows colours, and said twice: a test that did not run has not passed.
    pub fn not_run(&mut self, name: &str, why: &str) {
        let line = format!("\x1b[1;31mNOT RUN {name}: {why}\x1b[0m");
        eprintln!("{line}");
        self.0.push(line);
    }

    /// Prints all steps.
    pub fn print(&self) {
        println!();
        for line in &self.0 {
            println!("{line}");
        }
    }
}
