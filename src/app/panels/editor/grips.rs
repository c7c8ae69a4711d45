//! Points of the curve that lie over each other.

use eframe::egui::Pos2;

/// The selected point may be farther from the hand than another by this many points of the screen, and still be meant.
const LEAN: f32 = 6.0;

/// The order in which points are put on screen: where they overlap, the last one takes the hand and is seen whole. That
/// is the one that is nearest to the hand, the selected one before others.
pub fn order(places: &[Pos2], hand: Option<Pos2>, selected: Option<usize>) -> Vec<usize> {
    let far = |i: usize| {
        let distance = hand.map_or(0.0, |hand| hand.distance(places[i]));
        if selected == Some(i) { distance - LEAN } else { distance }
    };
    let mut order: Vec<usize> = (0..places.len()).collect();
    // Stable: of points at one place the later is on top, as without a hand.
    order.sort_by(|a, b| far(*b).total_cmp(&far(*a)));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::pos2;

    #[test]
    fn the_nearest_is_on_top_and_the_selected_one_before_others() {
        let places = [pos2(0.0, 0.0), pos2(4.0, 0.0), pos2(4.0, 0.0), pos2(50.0, 0.0)];
        let top = |hand, selected| *order(&places, hand, selected).last().unwrap();
        assert_eq!(order(&places, None, None), [0, 1, 2, 3]);
        assert_eq!(top(None, Some(1)), 1);
        assert_eq!(top(Some(pos2(-1.0, 0.0)), None), 0);
        assert_eq!(top(Some(pos2(5.0, 0.0)), None), 2);
        assert_eq!(top(Some(pos2(5.0, 0.0)), Some(0)), 0, "only a little farther");
        assert_eq!(top(Some(pos2(5.0, 0.0)), Some(1)), 1, "under another");
        assert_eq!(top(Some(pos2(49.0, 0.0)), Some(0)), 3, "nowhere near");
        let mut all = order(&places, Some(pos2(9.0, 9.0)), Some(3));
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3]);
    }
}
