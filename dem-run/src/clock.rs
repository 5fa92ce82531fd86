//! Processor time.

use rustix::time::{ClockId, clock_gettime};

/// Processor time of the program so far (s).
#[must_use]
pub fn cpu_time() -> f64 {
    read(ClockId::ProcessCPUTime)
}

/// Processor time of this thread so far (s).
#[must_use]
pub fn thread_time() -> f64 {
    read(ClockId::ThreadCPUTime)
}

fn read(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
