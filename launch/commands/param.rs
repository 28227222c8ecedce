//! `tricurve param`: the parameters of a graph that runs.

use std::collections::BTreeMap;

use messages::bus::{Answer, Ask, Parameter, State, ask};
use messages::change::shown;
use serde_json::{Value, json};

use crate::cli::{ParamArgs, ParamCommand};
use crate::graph::parsed;
use crate::running::Running;
use crate::{Failure, Outcome};

pub(crate) fn run(args: &ParamArgs) -> Result<Outcome, Failure> {
    let running = Running::choose(args.asked.run.as_deref())?;
    match &args.command {
        ParamCommand::List => list(&state(&running)?.parameters, args.asked.json)?,
        ParamCommand::Get { name } => get(
            &running,
            &state(&running)?.parameters,
            name,
            args.asked.json,
        )?,
        ParamCommand::Set { values } => set(&running, values)?,
    }
    Ok(Outcome::Done)
}

fn answer(running: &Running, what: &Ask) -> Result<Answer, Failure> {
    ask(&running.folder, what).map_err(|error| {
        let name = running.name();
        Failure::failed(format!("the launcher of {name} does not answer: {error}"))
    })
}

fn state(running: &Running) -> Result<State, Failure> {
    match answer(running, &Ask::State)? {
        Answer::State(state) => Ok(*state),
        Answer::Refused { why } => Err(Failure::failed(why)),
        answer => Err(Failure::failed(format!("it answers {answer:?}"))),
    }
}

fn list(parameters: &[Parameter], json: bool) -> Result<(), Failure> {
    if json {
        return super::print_json(&parameters);
    }
    let rows = parameters.iter().map(|parameter| {
        let Parameter {
            name,
            value,
            about,
            range,
        } = parameter;
        let range = range.map_or(String::new(), |(least, most)| format!("{least} to {most}"));
        [name.clone(), shown(value), range, first_sentence(about)]
    });
    super::print(&super::aligned(&rows.collect::<Vec<_>>()))
}

/// What a parameter is; what is known of it beyond that `tricurve validate` prints.
fn first_sentence(about: &str) -> String {
    match about.find(". ") {
        Some(end) => about[..=end].to_owned(),
        None => about.to_owned(),
    }
}

/// A setting that holds for the whole run, by its name; where the source found it out, what it found.
fn fixed(running: &Running, name: &str) -> Option<Value> {
    let (node, key) = name.split_once('.')?;
    let rail = running.orders.run.rig.rail;
    match (name, rail) {
        ("capture.stride", Some(rail)) => return Some(json!(rail.stride)),
        ("capture.drift", Some(rail)) => return Some(json!(rail.drift_px)),
        _ => {}
    }
    running.orders.configuration.get(node)?.get(key).cloned()
}

fn get(running: &Running, parameters: &[Parameter], name: &str, json: bool) -> Result<(), Failure> {
    let found = parameters.iter().find(|parameter| parameter.name == name);
    if let (None, Some(value)) = (found, fixed(running, name)) {
        if json {
            return super::print_json(&json!({ "name": name, "value": value, "fixed": true }));
        }
        crate::say!("{name} holds for the whole run, and cannot be set while it goes on");
        return super::print(&format!("{}\n", shown(&value)));
    }
    let Some(parameter) = found else {
        let known = parameters.iter().map(|parameter| parameter.name.as_str());
        let near = messages::settings::nearest(name, known);
        let near = near.map_or(String::new(), |near| format!("; do you mean {near}?"));
        let text = format!("there is no parameter {name}{near}");
        return Err(Failure::usage(text));
    };
    match json {
        true => super::print_json(parameter),
        false => super::print(&format!("{}\n", shown(&parameter.value))),
    }
}

fn set(running: &Running, values: &[String]) -> Result<(), Failure> {
    let mut set = BTreeMap::new();
    for value in values {
        let Some((name, value)) = value.split_once('=') else {
            let text = format!("param set expects node.key=value, not {value:?}");
            return Err(Failure::usage(text));
        };
        let value: Value = parsed(value);
        set.insert(name.trim().to_owned(), value);
    }
    match answer(running, &Ask::Set { values: set })? {
        Answer::Done { text } => super::print(&format!("{text}\n")),
        Answer::Refused { why } => Err(Failure::usage(why)),
        Answer::State(_) | Answer::Said { .. } => Ok(()),
    }
}
