//! The page as HTML.

use askama::Template;

use crate::output::{PostError, Result};
use crate::section::Section;

/// The page.
#[derive(Template)]
#[template(path = "report.html")]
struct Filled<'a> {
    page: &'a Page,
    style: &'static str,
    script: &'static str,
}

/// The content of a page: its sections, and after them a scene.
pub struct Page {
    /// Its title.
    pub title: String,
    /// Its sections.
    pub sections: Vec<Section>,
    /// Where the times of the run count steps, what a step adds to them (s).
    pub step: Option<f64>,
    /// The scene.
    pub scene: String,
    /// The line above the scene.
    pub scene_of: String,
}

const STYLE: &str = include_str!("../../templates/report.css");
const SCRIPT: &str = include_str!("../../templates/report.js");

impl Page {
    /// The page as HTML.
    ///
    /// # Errors
    /// [`PostError::Usage`] with the message of the template.
    pub fn render(&self) -> Result<String> {
        let filled = Filled { page: self, style: STYLE, script: SCRIPT };
        filled.render().map_err(|error| PostError::Usage(format!("the page: {error}")))
    }
}

/// A scene in lines; one that is not JSON, unchanged.
pub fn pretty(scene: &str) -> String {
    let tree: serde_json::Value = serde_json::from_str(scene).unwrap_or_default();
    if tree.is_null() { scene.into() } else { serde_json::to_string_pretty(&tree).unwrap_or_else(|_| scene.into()) }
}
