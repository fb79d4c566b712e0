use super::*;

#[test]
fn no_request_of_a_plan_replaces_one_of_another_kind() {
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0]] {
        let requests = PlanRequests::new();
        order
            .into_iter()
            .chain([1, 1])
            .for_each(|at: usize| requests.add(PlanKind::BY_URGENCY[at]));
        let [detour, division, mission] = PlanKind::BY_URGENCY.map(Some);
        let taken = [(); 4].map(|()| requests.take());
        assert_eq!(taken, [detour, division, mission, None], "{order:?}");
    }
}
