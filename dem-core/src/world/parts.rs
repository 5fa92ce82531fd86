//! A step in parts: halved where a solve is refused or bodies are too fast for it. Its forces are
//! the means over its parts.

use super::World;
use super::report::{PARTS, StepError, StepReport};
use crate::dim::Dim;

impl<D: Dim> World<D> {
    /// One step of length `h`, or two of half that length if its solve is refused or bodies are too
    /// fast for it; the step of the scene is `parts` × `h`.
    pub(super) fn advance(
        &mut self,
        h: f64,
        halvings: u32,
        parts: u32,
        watch: &mut dyn FnMut(usize),
    ) -> Result<StepReport<D>, StepError> {
        let last_attempt = halvings == self.settings.max_halvings;
        let refused = match self.attempt(h, last_attempt, watch) {
            Err(StepError::NotAccepted { .. }) if halvings < self.settings.max_halvings => 1,
            Err(StepError::Yielded { violation, .. })
                if violation.is_of_the_solve() && halvings < self.settings.max_halvings =>
            {
                1
            }
            Err(StepError::TooFast { .. }) if parts < PARTS => 0,
            outcome => return outcome,
        };
        let before = self.snapshot();
        let first = self.advance(0.5 * h, halvings + refused, 2 * parts, watch)?;
        let forces = Forces::of(self, &first);
        let mut watch_second = |broken| watch(first.breaks.len() + broken);
        match self.advance(0.5 * h, halvings + refused, 2 * parts, &mut watch_second) {
            Ok(second) => {
                let stress = forces.averaged(self, [&first, &second]);
                Ok(StepReport { mean_stress: Some(stress), ..first.followed_by(second, refused) })
            }
            Err(error) => {
                // after the first half the world is in neither the old state nor the new one
                self.restore(before);
                Err(error)
            }
        }
    }
}

/// The forces of a part.
struct Forces<D: Dim> {
    /// Of each wall: reaction, reaction at the first rupture, and applied force (N).
    walls: Vec<([D::Vector; 2], f64)>,
    /// Pressure of the membrane (Pa).
    pressure: f64,
    stress: Vec<f64>,
}

impl<D: Dim> Forces<D> {
    fn of(world: &World<D>, report: &StepReport<D>) -> Self {
        Self {
            walls: world.walls.iter().map(|w| ([w.reaction, w.reaction_at_limit], w.applied)).collect(),
            pressure: world.membrane.as_ref().map_or(0.0, |membrane| membrane.applied),
            stress: report.stress(world),
        }
    }

    /// Give the world the means of these forces and of those after the second half. Returns the
    /// mean stress. The forces of the first rupture remain those of the part in which it is.
    fn averaged(self, world: &mut World<D>, [first, second]: [&StepReport<D>; 2]) -> Vec<f64> {
        let now = Self::of(world, second);
        for (wall, ([reaction, at_limit], applied)) in world.walls.iter_mut().zip(self.walls) {
            wall.reaction = (wall.reaction + reaction) * 0.5;
            wall.applied = 0.5 * (wall.applied + applied);
            if !first.breaks.is_empty() {
                wall.reaction_at_limit = at_limit;
            } else if second.breaks.is_empty() {
                wall.reaction_at_limit = wall.reaction;
            }
        }
        if let Some(membrane) = &mut world.membrane {
            membrane.applied = 0.5 * (membrane.applied + self.pressure);
        }
        now.stress.iter().zip(&self.stress).map(|(now, before)| 0.5 * (now + before)).collect()
    }
}
