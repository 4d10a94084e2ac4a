//! `extras` of cameras, nodes and lights against the documented ranges: a value that is in range arrives as it is, any
//! other refuses the file in a sentence that names it, and what is not ours is left alone.

use crate::{Random, fuzz};
use graeco::scene::gltf::{LoadOptions, load};
use graeco::scene::{LightShape, Scene};
use serde_json::{Map, Value, json};
use std::fs;

/// A key, the least value and the largest, whether the least itself is allowed.
type Rule = (&'static str, f64, f64, bool);

const CAMERA: [Rule; 4] = [
    ("f_stop", 0.0, f64::MAX, false),
    ("aperture_radius", 0.0, f64::MAX, true),
    ("focus_distance", 0.0, f64::MAX, false),
    ("shutter_angle", 0.0, f64::MAX, true),
];
const NODE: [Rule; 1] = [("motion:blurScale", 0.0, f64::MAX, true)];
const SUN: [Rule; 1] = [("angle", 0.0, 180.0, true)];
const LAMP: [Rule; 1] = [("radius", 0.0, f64::MAX, true)];

/// Something that a key may hold.
fn value(random: &mut Random) -> Value {
    match random.below(12) {
        0 => json!("0.5"),
        1 => Value::Null,
        2 => json!(true),
        3 => json!([1.0]),
        4 => json!({"value": 1.0}),
        5 => json!(random.pick(&[-1.0, -0.0, -1e-300, -1e300])),
        6 => json!(random.pick(&[1e39, 1e300, 1e-46, 1e-300, f64::MAX, f64::from(f32::MAX)])),
        7 => json!(random.next()),
        8 => json!(random.pick(&[0, 1, 180, 181, 360])),
        _ => json!(random.unit() * random.pick(&[1.0, 200.0, 1e6])),
    }
}

/// `extras` with some of the rules' keys and some that mean nothing.
fn extras(rules: &[Rule], random: &mut Random) -> Value {
    let mut map = Map::new();
    for (key, ..) in rules {
        if random.below(3) == 0 {
            map.insert((*key).to_owned(), value(random));
        }
    }
    if random.below(4) == 0 {
        map.insert(random.pick(&["F_STOP", "motion:blurscale", "", "radius "]).to_owned(), value(random));
    }
    match random.below(20) {
        0 => json!("no object"),
        1 => json!([map]),
        _ => Value::Object(map),
    }
}

/// What `rule` makes of `extras`: nothing there, a value, or a refusal.
fn expected(extras: &Value, rule: Rule) -> Result<Option<f32>, ()> {
    let Some(value) = extras.as_object().and_then(|map| map.get(rule.0)) else { return Ok(None) };
    let number = value.as_f64().ok_or(())?;
    let narrow = number as f32;
    // In range as it is kept, and as it is written.
    let fits = number >= rule.1 && number <= rule.2 && (rule.3 || narrow >= f32::MIN_POSITIVE);
    if fits && narrow.is_finite() { Ok(Some(narrow)) } else { Err(()) }
}

/// The values of the loaded scene in the order of the rules, by what the file's parts said.
fn found(scene: &Scene) -> [Option<f32>; 7] {
    let lens = &scene.cameras[0].lens;
    let size = |i: usize| match scene.lights[i].shape {
        LightShape::Directional { angular_radius } => Some(angular_radius),
        LightShape::Point { radius } | LightShape::Spot { radius, .. } => Some(radius),
    };
    let blur = scene.nodes.iter().find(|n| n.name == "Eye").unwrap().blur_scale;
    [lens.f_stop, lens.aperture_radius, lens.focus_distance, lens.shutter_angle, blur, size(0), size(1)]
}

#[test]
fn extras_arrive_in_range_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("extras.gltf");
    let (mut accepted, mut refused) = (0, 0);
    fuzz("extras", 1000, |iteration, random| {
        let [camera, node, sun, lamp] =
            [&CAMERA[..], &NODE[..], &SUN[..], &LAMP[..]].map(|rules| extras(rules, random));
        let file = json!({
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [
                {"type": "directional", "extras": sun}, {"type": "point", "extras": lamp}]}},
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}, "extras": camera}],
            "nodes": [{"name": "Eye", "camera": 0, "extras": node},
                {"extensions": {"KHR_lights_punctual": {"light": 0}}},
                {"extensions": {"KHR_lights_punctual": {"light": 1}}}],
        });
        fs::write(&path, file.to_string()).unwrap();
        let of = |extras: &Value, rules: &[Rule]| -> Vec<_> { rules.iter().map(|r| expected(extras, *r)).collect() };
        let wanted = [of(&camera, &CAMERA), of(&node, &NODE), of(&sun, &SUN), of(&lamp, &LAMP)].concat();
        let about = || format!("iteration {iteration}: {file}");
        match load(&path, &LoadOptions::default()) {
            Err(e) => {
                refused += 1;
                assert!(wanted.contains(&Err(())), "refused without need: {e}\n{}", about());
                assert!(!e.to_string().contains('\n') && e.to_string().contains("extras."), "{e}\n{}", about());
            }
            Ok(scene) => {
                accepted += 1;
                for (i, (found, wanted)) in found(&scene).into_iter().zip(wanted).enumerate() {
                    let wanted = wanted.unwrap_or_else(|()| panic!("value {i} let through\n{}", about()));
                    // Lights without a size are points; a sun's angle is kept as a radius in radians.
                    let wanted = match i {
                        5 => Some(wanted.unwrap_or(0.0).to_radians() * 0.5),
                        6 => Some(wanted.unwrap_or(0.0)),
                        _ => wanted,
                    };
                    assert_eq!(found, wanted, "value {i}\n{}", about());
                }
            }
        }
    });
    assert!(accepted > 100 && refused > 100, "{accepted} accepted, {refused} refused");
}
