//! Returns to an earlier moment: by a duration, to the moment at which a condition became true, or to the start.

use super::{alone, go_to};
use crate::plant::Snapshot;
use crate::request::{Code, Host, Refused};
use crate::time;

/// Goes back by `us` microseconds. By 0 us nothing changes: the plant is in the state after the last action at the
/// present moment already.
pub(in crate::request) fn back(
    host: &mut dyn Host,
    us: u64,
    detached: bool,
    is_awaited: &mut dyn FnMut() -> bool,
) -> Result<(), Refused> {
    alone(host, detached)?;
    let now = host.plant().now();
    let target = now.checked_sub(us);
    let earliest = host.plant_and_travel().1.earliest();
    let Some(target) = target.filter(|target| earliest.is_some_and(|earliest| earliest <= *target)) else {
        let text = earliest.map_or_else(
            || host.plant_and_travel().1.nothing(),
            |earliest| {
                let [earliest, now] = [earliest, now].map(time::seconds);
                format!("{} are too far: the earliest moment is {earliest}, it is {now} now", time::short(us))
            },
        );
        return Err(Refused::new(Code::NOT_SO_FAR, text));
    };
    if target == now {
        return Ok(());
    }
    let here = host.plant().snapshot();
    let search = host.plant_mut().search();
    let outcome = arrive(host, target, &here, detached, is_awaited);
    host.plant_mut().end_search(search);
    host.has_travelled();
    outcome
}

/// Goes back to the start, before the first action of a client.
pub(in crate::request) fn back_to_start(host: &mut dyn Host, detached: bool) -> Result<(), Refused> {
    alone(host, detached)?;
    let (_, travel) = host.plant_and_travel();
    if travel.most == 0 {
        return Err(Refused::new(Code::NOT_SO_FAR, travel.nothing()));
    }
    if travel.came_from_elsewhere {
        return Err(Refused::new(Code::NOT_SO_FAR, travel.no_start()));
    }
    // Without a snapshot of the start, the plant is still at its start.
    let Some(start) = travel.start.clone() else { return Ok(()) };
    go_to(host, &start, true)?;
    let (plant, travel) = host.plant_and_travel();
    travel.begins_anew(plant);
    host.has_travelled();
    Ok(())
}

/// Goes back to the last moment at which `look` changed from returning nothing to returning a result. Returns this
/// result. If `is_awaited` returns false, ends the search at the present moment.
pub(in crate::request) fn back_until<T>(
    host: &mut dyn Host,
    detached: bool,
    look: impl Fn(&dyn Host) -> Result<Option<T>, Refused>,
    is_awaited: &mut dyn FnMut() -> bool,
) -> Result<T, Refused> {
    alone(host, detached)?;
    let search = host.plant_mut().search();
    let outcome = find_back(host, detached, look, is_awaited);
    host.plant_mut().end_search(search);
    host.has_travelled();
    outcome
}

fn find_back<T>(
    host: &mut dyn Host,
    detached: bool,
    look: impl Fn(&dyn Host) -> Result<Option<T>, Refused>,
    is_awaited: &mut dyn FnMut() -> bool,
) -> Result<T, Refused> {
    let here = host.plant().snapshot();
    // The plant is still at power-on, so a condition that is true now became true there.
    if here.time_us() == 0
        && let Some(found) = look(host)?
    {
        return Ok(found);
    }
    // The start of the next stretch, and whether `look` returns a result at that moment. After the loop, this is the
    // earliest moment of the history.
    let mut next_stretch = (here.time_us(), false);
    // A stretch that begins at the present moment has no earlier moment, and may lack the last actions.
    let earlier = host.plant_and_travel().1.count_before(here.time_us());
    for place in (0..earlier).rev() {
        let found = last_in(host, place, next_stretch, &look, is_awaited);
        go_on(host, &here, is_awaited)?;
        let (found, first) = found.inspect_err(|_| return_to(host, &here))?;
        // A condition that is true at power-on became true there. At another earliest moment it may have been true before.
        let is_power_on = place == 0 && first == (0, true);
        if let Some(target) = found.or(is_power_on.then_some(0)) {
            arrive(host, target, &here, detached, is_awaited)?;
            if let Some(found) = look(host)? {
                return Ok(found);
            }
            // The condition became true by an event at this moment, so the event is handled, too.
            host.plant_mut().advance_to(target);
            let (plant, travel) = host.plant_and_travel();
            travel.is_at(plant);
            let none =
                || Refused::new(Code::NOT_SO_FAR, "the moment was found, but not again on the way there");
            return look(host)?.ok_or_else(none);
        }
        next_stretch = first;
    }
    // Without an earlier stretch, the plant is still at the present moment.
    let is_true = if earlier == 0 { look(host)?.is_some() } else { next_stretch.1 };
    let unrepeatable = last_unrepeatable(host, is_awaited);
    go_on(host, &here, is_awaited)?;
    return_to(host, &here);
    let earliest = host.plant_and_travel().1.earliest();
    let text = earliest.map_or_else(
        || host.plant_and_travel().1.nothing(),
        |earliest| {
            let earliest = time::seconds(earliest);
            let since = if is_true { "have been true since before" } else { "did not become true since" };
            let text = format!("the conditions {since} {earliest}, the earliest moment of the history");
            match unrepeatable {
                None => text,
                Some(times) => {
                    format!(
                        "{text}; but {}, so a condition about its actions is not found",
                        outside_action(times)
                    )
                }
            }
        },
    );
    Err(Refused::new(Code::NOT_SO_FAR, text))
}

/// Returns begin and end, in microseconds, of the last stretch that the plant cannot repeat with the same result.
fn last_unrepeatable(host: &mut dyn Host, is_awaited: &mut dyn FnMut() -> bool) -> Option<[u64; 2]> {
    (0..host.plant_and_travel().1.history.len()).rev().find_map(|place| {
        if must_end(host, is_awaited) {
            return None;
        }
        let stretch = host.plant_and_travel().1.history[place].clone();
        go_to(host, &stretch.begin, true).ok()?;
        let times = [stretch.begin.time_us(), stretch.end_us()];
        (!stretch.is_repeated(host.plant_mut(), is_awaited)).then_some(times)
    })
}

/// Returns the reason why the plant cannot repeat a stretch from a time to a time, in microseconds.
fn outside_action(times: [u64; 2]) -> String {
    let [from, end] = times.map(time::seconds);
    format!(
        "between {from} and {end} a program with mapped registers, or a guest at a door, has acted on the plant, which \
         cannot be repeated"
    )
}

/// Returns the last moment in a stretch, or at the beginning of the next one, at which `look` began to return a result.
/// Also returns the start of this stretch, and whether `look` returns a result there.
fn last_in<T>(
    host: &mut dyn Host,
    place: usize,
    (end, is_behind): (u64, bool),
    look: &impl Fn(&dyn Host) -> Result<Option<T>, Refused>,
    is_awaited: &mut dyn FnMut() -> bool,
) -> Result<(Option<u64>, (u64, bool)), Refused> {
    let stretch = host.plant_and_travel().1.history[place].clone();
    go_to(host, &stretch.begin, true)?;
    let mut way = stretch.way(u64::MAX);
    way.go_to(host.plant_mut(), stretch.begin.time_us(), is_awaited);
    let first = (stretch.begin.time_us(), look(host)?.is_some());
    let (mut is_found, mut last) = (first.1, None);
    loop {
        let next = host.plant().next_change().min(way.next_store());
        if next >= end || must_end(host, is_awaited) {
            break;
        }
        way.go_to(host.plant_mut(), next, is_awaited);
        // Handles the events that were due at the begin of the stretch, if `next` is this moment.
        host.plant_mut().advance_to(next);
        if !core::mem::replace(&mut is_found, look(host)?.is_some()) && is_found {
            last = Some(next);
        }
    }
    Ok(((is_behind && !is_found).then_some(end).or(last), first))
}

/// Moves the plant to a moment of the history. `here` is a snapshot from the time of the request; the plant returns to
/// it if the request is refused or must end early. The history then stays complete.
fn arrive(
    host: &mut dyn Host,
    target: u64,
    here: &Snapshot,
    detached: bool,
    is_awaited: &mut dyn FnMut() -> bool,
) -> Result<(), Refused> {
    let (_, travel) = host.plant_and_travel();
    let place = travel.stretch_of(target).ok_or_else(|| Refused::new(Code::NOT_SO_FAR, travel.nothing()))?;
    let stretch = travel.history[place].clone();
    if target > stretch.begin.time_us() && !detached {
        go_to(host, &stretch.begin, true)?;
        let end = stretch.end_us();
        let is_repeated = stretch.is_repeated(host.plant_mut(), is_awaited);
        go_on(host, here, is_awaited)?;
        if !is_repeated {
            return_to(host, here);
            let begin = stretch.begin.time_us();
            let text = format_args!(
                "{}; go back to {}, or give --ignore-programs to go without its actions",
                outside_action([begin, end]),
                time::seconds(begin)
            );
            return Err(Refused::new(Code::NOT_ALONE, text));
        }
    }
    go_to(host, &stretch.begin, true)?;
    stretch.way(target).go_to(host.plant_mut(), target, is_awaited);
    go_on(host, here, is_awaited)?;
    let (plant, travel) = host.plant_and_travel();
    travel.is_at(plant);
    Ok(())
}

/// True if the return must end early: the host must end, or the client no longer waits for the reply.
fn must_end(host: &dyn Host, is_awaited: &mut dyn FnMut() -> bool) -> bool {
    host.should_stop() || !is_awaited()
}

/// Returns to the moment of the request if the return must end early: the plant may not have reached the moment of the
/// history.
///
/// # Errors
/// The return must end early.
fn go_on(host: &mut dyn Host, here: &Snapshot, is_awaited: &mut dyn FnMut() -> bool) -> Result<(), Refused> {
    if !must_end(host, is_awaited) {
        return Ok(());
    }
    return_to(host, here);
    if host.should_stop() {
        return Err(Refused::ending(host));
    }
    Err(Refused::new(Code::NOT_SO_FAR, "the client no longer waits for the return"))
}

/// Returns to the moment of the request, because the request is refused. The result is ignored: restoring a snapshot of
/// the same plant succeeds.
fn return_to(host: &mut dyn Host, here: &Snapshot) {
    let _ = go_to(host, here, true);
}
