//! Camera paths for `render --path`.
//!
//! JSON: a list of cameras, or an object `{"cameras": [...], "fps": N}`. A camera is the text of `--camera`
//! (`"ex,ey,ez,tx,ty,tz"`), a list of the six numbers, or `{"eye": [x, y, z], "target": [x, y, z]}`. With `fps` the
//! frames after the first are what a viewer moving at that rate shows, morphs and missing pages included; without, each
//! frame is settled. With `"units": "radii"` places are told from the centre of the model's bounding sphere in radii of it, so that
//! one path does for all models; else they are in the model's units.

use crate::NativeError;
use glam::DVec3;
use marquetry_engine::Camera;
use marquetry_engine::camera::BoundingSphere;
use marquetry_format::Metadata;
use std::path::Path;

/// Most cameras in a path.
const MOST_CAMERAS: usize = 100_000;

/// A camera path.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// One a frame; not empty.
    pub cameras: Vec<Camera>,
    /// Frames a second; `None` to settle every frame.
    pub fps: Option<f64>,
}

#[derive(serde::Deserialize)]
#[serde(untagged)]
enum File {
    List(Vec<Entry>),
    Object {
        cameras: Vec<Entry>,
        fps: Option<f64>,
        #[serde(default)]
        units: Units,
    },
}

/// What places are told in.
#[derive(Debug, Clone, Copy, Default, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum Units {
    /// Those of the model.
    #[default]
    Model,
    /// Radii of the bounding sphere, from its centre.
    Radii,
}

#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Entry {
    Text(String),
    Numbers([f64; 6]),
    Points { eye: [f64; 3], target: [f64; 3] },
}

/// Reads the path in the file at `path`, for the model that `metadata` describes.
///
/// # Errors
/// When the file cannot be read or is not a camera path.
pub fn read(path: &Path, metadata: &Metadata) -> Result<CameraPath, NativeError> {
    let text = std::fs::read_to_string(path).map_err(|cause| NativeError::File {
        path: path.to_owned(),
        cause,
    })?;
    parse(&text, metadata).map_err(|reason| NativeError::CameraPath {
        path: path.to_owned(),
        reason,
    })
}

fn parse(text: &str, metadata: &Metadata) -> Result<CameraPath, String> {
    const EXPECTED: &str =
        "expected a list of cameras, each \"ex,ey,ez,tx,ty,tz\", six numbers, or {eye, target}";
    let value: serde_json::Value =
        serde_json::from_str(text).map_err(|error| format!("not JSON: {error}"))?;
    let file = serde_json::from_value(value).map_err(|error| format!("{EXPECTED} ({error})"))?;
    let (entries, fps, units) = match file {
        File::List(entries) => (entries, None, Units::default()),
        File::Object {
            cameras,
            fps,
            units,
        } => (cameras, fps, units),
    };
    let sphere = BoundingSphere::of(metadata);
    let placed = |place: DVec3| match units {
        Units::Model => place,
        Units::Radii => sphere.centre + sphere.radius * place,
    };
    if entries.is_empty() || entries.len() > MOST_CAMERAS {
        return Err(format!(
            "{} cameras; 1 to {MOST_CAMERAS} are possible",
            entries.len()
        ));
    }
    if fps.is_some_and(|fps| !(fps.is_finite() && fps > 0.0)) {
        return Err("fps must be above 0".to_owned());
    }
    let camera = |(index, entry): (usize, Entry)| {
        let text = match entry {
            Entry::Text(text) => text,
            Entry::Numbers(numbers) => numbers.map(|n| n.to_string()).join(","),
            Entry::Points {
                eye: [a, b, c],
                target: [d, e, f],
            } => [a, b, c, d, e, f].map(|n| n.to_string()).join(","),
        };
        let camera = Camera::parse(metadata, &text);
        let camera = camera.map_err(|error| format!("camera {index}: {error}"))?;
        Ok::<_, String>(Camera {
            eye: placed(camera.eye),
            target: placed(camera.target),
            up: camera.up,
        })
    };
    let cameras = entries
        .into_iter()
        .enumerate()
        .map(camera)
        .collect::<Result<_, _>>()?;
    Ok(CameraPath { cameras, fps })
}

#[cfg(test)]
mod tests {
    use super::*;
    use marquetry_engine::testing::metadata;

    #[test]
    fn all_spellings_of_a_camera_mean_the_same() {
        let text = r#"{"cameras": ["0,0,5,0,0,0", [0,0,5,0,0,0], {"eye": [0,0,5], "target": [0,0,0]}], "fps": 30}"#;
        let path = parse(text, &metadata()).unwrap();
        assert_eq!(path.fps, Some(30.0));
        assert_eq!(path.cameras.len(), 3);
        assert!(path.cameras.iter().all(|camera| *camera == path.cameras[0]));
        assert_eq!(parse(r#"["0,0,5,0,0,0"]"#, &metadata()).unwrap().fps, None);
    }

    #[test]
    fn radii_are_told_from_the_centre_of_the_model() {
        let of = |units| {
            let text = format!(r#"{{"cameras": [[0,0,2.5,0,0,0]], "units": "{units}"}}"#);
            parse(&text, &metadata()).unwrap().cameras[0]
        };
        let standard = Camera::standard(&metadata(), 0, 2.5).unwrap();
        assert!(of("radii").eye.distance(standard.eye) < 1e-9 * standard.eye.length());
        assert_eq!(of("radii").target, standard.target);
        assert_eq!(of("model").eye, DVec3::new(0.0, 0.0, 2.5));
        let text = r#"{"cameras": [[0,0,1,0,0,0]], "units": "miles"}"#;
        assert!(parse(text, &metadata()).is_err());
    }

    #[test]
    fn wrong_paths_say_what_is_wrong() {
        for (text, part) in [
            ("[", "not JSON"),
            ("[]", "0 cameras"),
            ("3", "expected a list"),
            (r#"["0,0,5,0,0,0", "1,2"]"#, "camera 1"),
            (r#"{"cameras": ["0,0,5,0,0,0"], "fps": 0}"#, "fps"),
        ] {
            let reason = parse(text, &metadata()).unwrap_err();
            assert!(reason.contains(part), "{reason}");
        }
    }
}
