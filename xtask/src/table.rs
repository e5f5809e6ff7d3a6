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
