//! Results as text for other programs: pure functions of the data, one file per format.

pub mod concise;
pub mod github;
pub mod gitlab;
pub mod json;
pub mod junit;
pub mod sarif;
pub mod tap;

mod finding;
mod repository;
mod run;

pub use finding::{Finding, Fix, RelatedPlace, Replacement, Totals, findings};
pub use repository::Repository;
pub use run::{Asked, Dropped, Expected, Frames, Gate, Lateness, Run, Unscripted};
