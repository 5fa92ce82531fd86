//! The page as HTML.

use askama::Template;
use dem_history::History;

use crate::output::{PostError, Result};
use crate::section::Section;

/// The page.
#[derive(Template)]
#[template(path = "report.html")]
struct Page {
    title: String,
    sections: Vec<Section>,
    scene: String,
    style: &'static str,
    script: &'static str,
}

const STYLE: &str = include_str!("../../templates/report.css");
const SCRIPT: &str = include_str!("../../templates/report.js");

/// The whole page: its sections, and after them the scene.
///
/// # Errors
/// Those of reading the history and of drawing.
pub fn render(history: &History, sections: Vec<Section>) -> Result<String> {
    let scene = history.parameters()?.scene;
    let tree: serde_json::Value = serde_json::from_str(&scene).unwrap_or_default();
    let name = history.path().file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let title = tree
        .get("title")
        .and_then(|title| title.as_str())
        .map_or_else(|| name.clone(), |title| format!("{name}: {title}"));
    // a scene that is not JSON is printed unchanged
    let scene = if tree.is_null() { scene } else { serde_json::to_string_pretty(&tree).unwrap_or(scene) };
    let page = Page { title, sections, scene, style: STYLE, script: SCRIPT };
    page.render().map_err(|error| PostError::Usage(format!("the page: {error}")))
}
