//! Frame lists against a model that makes them: what is written by the rules gives the frames meant, what is not is
//! refused or harmless.

use crate::{Random, fuzz};
use graeco::render::frames::FrameList;

/// Most frames in an item, so that a case takes no time.
const MOST: i64 = 300;

/// One item as text, and the frames that it means.
fn item(random: &mut Random) -> (String, Vec<i64>) {
    let base = random.pick(&[0_i64, 1, 100, -50, 999_999_999_000, -999_999_999_999, 4_294_967_290]);
    let from = base + random.below(90) as i64;
    let to = from + random.below(MOST as usize) as i64;
    let space = |random: &mut Random| if random.below(8) == 0 { " " } else { "" };
    let (a, b) = (space(random), space(random));
    match random.below(3) {
        0 => (format!("{a}{from}{b}"), vec![from]),
        1 => (format!("{a}{from}-{to}{b}"), (from..=to).collect()),
        _ => {
            let step = 1 + random.below(9);
            let sign = random.pick(&["x", ":"]);
            (format!("{a}{from}-{to}{sign}{step}{b}"), (from..=to).step_by(step).collect())
        }
    }
}

#[test]
fn lists_give_the_frames_that_they_were_written_for() {
    fuzz("frame lists", 500, |iteration, random| {
        let items: Vec<_> = (0..=random.below(4)).map(|_| item(random)).collect();
        let text = items.iter().map(|i| i.0.as_str()).collect::<Vec<_>>().join(",");
        let mut wanted: Vec<i64> = Vec::new();
        for frame in items.into_iter().flat_map(|i| i.1) {
            if !wanted.contains(&frame) {
                wanted.push(frame);
            }
        }
        let list: FrameList = text.parse().unwrap_or_else(|e| panic!("iteration {iteration}: {text}: {e}"));
        assert_eq!(list.frames(), wanted, "iteration {iteration}: {text}");
        let again: FrameList = list.to_string().parse().unwrap();
        assert_eq!(again, list, "iteration {iteration}: the list as shown is the list");
        broken(iteration, &text, random);
    });
}

/// A text with something changed: whatever it is taken for, each frame comes once, and a refusal is one sentence.
fn broken(iteration: u64, text: &str, random: &mut Random) {
    const HARM: [&str; 16] =
        ["", "-", "--", ",", ",,", "x", ":", " ", "0", "9", "x0", ":-1", "e", "+", "９", "99999999999999999999"];
    let mut chars: Vec<String> = text.chars().map(String::from).collect();
    for _ in 0..=random.below(2) {
        let at = random.below(chars.len());
        chars[at] = random.pick(&HARM).to_owned();
    }
    let text = chars.concat();
    match text.parse::<FrameList>() {
        Ok(list) => {
            let mut seen = list.frames().to_vec();
            seen.sort_unstable();
            assert!(!seen.is_empty() && seen.windows(2).all(|w| w[0] < w[1]), "iteration {iteration}: {text}");
        }
        Err(e) => assert!(!e.to_string().contains('\n'), "iteration {iteration}: {text}: {e}"),
    }
}
