//! A writer on its own thread, so that the run does not wait for the disk.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use super::checkpoint::Checkpoint;
use super::ending::Ending;
use super::error::Result;
use super::model::{Bonds, Frame, Rupture};
use super::writer::Writer;

/// Maximum number of batches in the queue.
const WAITING: usize = 4;

/// A batch: observations and ruptures since the last batch, then a frame, then a checkpoint, at
/// last why the run ended.
#[derive(Debug, Default)]
pub struct Batch {
    /// Steps, times and observables, one row each.
    pub observations: Vec<(i64, f64, Vec<f64>)>,
    /// Bonds that a stage formed since the last batch, before all others of this one.
    pub bonds: Option<Bonds>,
    /// Bonds that broke.
    pub ruptures: Vec<Rupture>,
    /// The frame that makes them visible.
    pub frame: Option<Frame>,
    /// The state of that frame.
    pub checkpoint: Option<Checkpoint>,
    /// Why the run ended.
    pub ending: Option<Ending>,
}

/// A [`Writer`] on its own thread.
pub struct Background {
    batches: Option<SyncSender<Batch>>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl Background {
    /// Starts a thread that writes the batches.
    pub fn start(writer: Writer) -> Self {
        let (batches, waiting) = sync_channel(WAITING);
        let thread = std::thread::spawn(move || write_all(writer, &waiting));
        Self { batches: Some(batches), thread: Some(thread) }
    }

    /// Queues a batch; waits while the queue is full.
    ///
    /// # Errors
    /// The error that ended the writer, for this batch or one before it.
    pub fn write(&mut self, batch: Batch) -> Result<()> {
        match &self.batches {
            Some(batches) if batches.send(batch).is_ok() => Ok(()),
            // the thread ended, by an error that it returns
            _ => self.end(),
        }
    }

    /// Waits until everything is written, and closes the file.
    ///
    /// # Errors
    /// The error that ended the writer.
    pub fn finish(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        self.batches = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Ok(()),
        }
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        // the error is already returned elsewhere; the file is valid up to its last frame
        let _ = self.end();
    }
}

fn write_all(mut writer: Writer, batches: &Receiver<Batch>) -> Result<()> {
    for batch in batches {
        if let Err(error) = write(&mut writer, &batch) {
            writer.abandon();
            return Err(error);
        }
    }
    writer.finish()
}

fn write(writer: &mut Writer, batch: &Batch) -> Result<()> {
    if let Some(bonds) = &batch.bonds {
        writer.bonds_formed(bonds)?;
    }
    for (step, time, values) in &batch.observations {
        writer.observe(*step, *time, values)?;
    }
    for rupture in &batch.ruptures {
        writer.rupture(rupture)?;
    }
    if let Some(frame) = &batch.frame {
        writer.frame(frame)?;
    }
    if let Some(checkpoint) = &batch.checkpoint {
        writer.checkpoint(checkpoint)?;
    }
    if let Some(ending) = batch.ending {
        writer.ending(ending)?;
    }
    Ok(())
}
