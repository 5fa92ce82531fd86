//! Why a run ended.

use serde::{Serialize, Serializer};

use super::codes::codes;

codes! {
    /// Whether a run ended, and why.
    Ending, EndingCode(u8, U1, signed = false),
    /// It has not ended, or was killed.
    Open = 0 "OPEN",
    /// The end of the scene's time.
    Time = 1 "TIME",
    /// The wall has moved far enough.
    WallTravel = 2 "WALL_TRAVEL",
    /// Enough bonds have broken.
    BrokenFraction = 3 "BROKEN_FRACTION",
    /// The load has dropped far enough below its peak.
    LoadDrop = 4 "LOAD_DROP",
    /// The last stage has ended.
    Stages = 5 "STAGES",
    /// Loading to the next event: no bond breaks under the loads up to the end of the scene's time.
    NoBreak = 6 "NO_BREAK",
    /// Loading to the next event: the bodies do not stay at rest under the load that comes next.
    NoEquilibrium = 7 "NO_EQUILIBRIUM",
    /// Ctrl-C or SIGTERM.
    Interrupted = 8 "INTERRUPTED",
    /// A step was not solved.
    NoConvergence = 9 "NO_CONVERGENCE"
}

impl Ending {
    /// The reason in words, with the fields of the scene.
    pub fn reason(self) -> &'static str {
        match self {
            Self::Open => "in progress, or killed",
            Self::Time => "time.end was reached",
            Self::WallTravel => "stop.wall_travel was reached",
            Self::BrokenFraction => "stop.broken_fraction was reached",
            Self::LoadDrop => "stop.load_drop was reached",
            Self::Stages => "the last of stages ended",
            Self::NoBreak => "the loads up to time.end break no further bond",
            Self::NoEquilibrium => "the sample bears no further load",
            Self::Interrupted => "interrupted",
            Self::NoConvergence => "a step was not solved",
        }
    }
}

impl Serialize for Ending {
    /// The name in lower case, as in `wall_travel`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.label().to_lowercase())
    }
}
