//! The model description of a unit, `modelDescription.xml`.

use super::archive::LIBRARY;
use super::unit::Unit;
use super::variables::{Causality, Variable, VariableType};
use crate::plain_text::is_interpreted;
use crate::xml_text;
use core::fmt::Write;

/// Units of the variables: name, exponent of each SI unit, and a display unit with its factor.
const UNITS: &str = "\
  <UnitDefinitions>
    <Unit name=\"s\"><BaseUnit s=\"1\"/></Unit>
    <Unit name=\"rad\"><BaseUnit rad=\"1\"/><DisplayUnit name=\"deg\" factor=\"57.29577951308232\"/></Unit>
    <Unit name=\"rad/s\"><BaseUnit s=\"-1\" rad=\"1\"/><DisplayUnit name=\"rev/min\" factor=\"9.549296585513721\"/></Unit>
  </UnitDefinitions>
";

/// Explains the marks of inferred facts.
const MARKS: &str = "\
<!-- A description names the facts of a register that the manual does not state after \"inferred:\", each with the
     decision (D-nn) from which it follows. The pages decisions.md in the documentation of commram give the reasons. Do not
     take those facts, above all offsets, for the device's without a check. -->
";

/// Generates the model description. `name` is the name of the model in tools.
#[must_use]
pub fn description(unit: &Unit, name: &str) -> String {
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    xml.push_str(MARKS);
    let version = env!("CARGO_PKG_VERSION");
    let _ = writeln!(
        xml,
        "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{}\" instantiationToken=\"{}\"\n  \
         description=\"Registers of controllers, with firmware, buses and drives behind them\"\n  \
         version=\"{version}\" generationTool=\"commram {version}\" variableNamingConvention=\"flat\">",
        escaped(name),
        unit.token(),
    );
    let _ = writeln!(
        xml,
        "  <CoSimulation modelIdentifier=\"{LIBRARY}\" canHandleVariableCommunicationStepSize=\"true\"\n    \
         fixedInternalStepSize=\"1e-6\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\"/>"
    );
    xml.push_str(UNITS);
    xml.push_str(
        "  <LogCategories>\n    \
         <Category name=\"logStatusError\" description=\"What was refused, and what would be right\"/>\n    \
         <Category name=\"findings\" description=\"What the access checker finds in the accesses to registers\"/>\n  \
         </LogCategories>\n",
    );
    xml.push_str("  <DefaultExperiment startTime=\"0\" stepSize=\"0.001\"/>\n  <ModelVariables>\n");
    for (reference, variable) in unit.variables().iter().enumerate() {
        of_variable(&mut xml, reference, variable);
    }
    xml.push_str("  </ModelVariables>\n  <ModelStructure>\n");
    for element in ["Output", "InitialUnknown"] {
        let outputs = unit.variables().iter().enumerate().filter(|(_, it)| it.causality == Causality::Output);
        for (reference, _) in outputs {
            let _ = writeln!(xml, "    <{element} valueReference=\"{reference}\"/>");
        }
    }
    xml.push_str("  </ModelStructure>\n</fmiModelDescription>\n");
    xml
}

fn of_variable(xml: &mut String, reference: usize, variable: &Variable) {
    let Variable { name, description, kind, causality, start, unit, .. } = variable;
    let variability = match (causality, kind) {
        (Causality::Parameter, _) => "tunable",
        (_, VariableType::F64) => "continuous",
        _ => "discrete",
    };
    let _ = write!(
        xml,
        "    <{} name=\"{}\" valueReference=\"{reference}\" causality=\"{}\" variability=\"{variability}\"",
        kind.name(),
        escaped(name),
        causality.name(),
    );
    if *causality == Causality::Output {
        xml.push_str(" initial=\"calculated\"");
    }
    if !unit.is_empty() {
        let _ = write!(xml, " unit=\"{unit}\"");
    }
    if let Some(start) = start {
        let _ = write!(xml, " start=\"{start}\"");
    }
    let _ = writeln!(xml, " description=\"{}\"/>", escaped(description));
}

/// Escapes a text for the value of an attribute.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '"' => escaped.push_str("&quot;"),
            sign if is_interpreted(sign) => escaped.push(' '),
            other if xml_text::is_allowed(other) => escaped.push(other),
            _ => escaped.push(char::REPLACEMENT_CHARACTER),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fmi::Resources;
    use quick_xml::Reader;
    use quick_xml::events::Event;

    #[test]
    fn texts_become_attributes() {
        assert_eq!(escaped("a \"b\" < c & d\n\u{ffff}"), "a &quot;b&quot; &lt; c &amp; d \u{fffd}");
    }

    #[test]
    fn every_variable_is_in_the_description_once_and_every_output_in_its_structure() {
        let unit = Unit::new(&Resources::built_in(Vec::new()).unwrap()).unwrap();
        let xml = description(&unit, "built-in & \"more\"");
        let mut reader = Reader::from_str(&xml);
        let (mut variables, mut outputs, mut unknowns) = (Vec::new(), 0, 0);
        loop {
            match reader.read_event().unwrap() {
                Event::Eof => break,
                Event::Empty(element) => {
                    let of = |name: &str| {
                        let found = element.try_get_attribute(name).unwrap();
                        found.map(|it| String::from_utf8(it.value.into_owned()).unwrap())
                    };
                    match String::from_utf8_lossy(element.name().as_ref()).as_ref() {
                        "Output" => outputs += 1,
                        "InitialUnknown" => unknowns += 1,
                        _ if of("valueReference").is_some() => {
                            assert_eq!(of("valueReference").unwrap(), variables.len().to_string());
                            let causality = of("causality").unwrap();
                            assert_eq!(of("start").is_some(), matches!(&*causality, "input" | "parameter"));
                            variables.push(causality);
                        }
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        assert_eq!(variables.len(), unit.variables().len());
        let expected = variables.iter().filter(|causality| *causality == "output").count();
        assert_eq!((outputs, unknowns), (expected, expected));
        assert!(xml.contains("modelName=\"built-in &amp; &quot;more&quot;\""));
        assert!(xml.contains("decision (D-nn)"));
    }

    #[test]
    fn a_description_names_the_inferred_facts() {
        let unit = Unit::new(&Resources::built_in(Vec::new()).unwrap()).unwrap();
        let about = |name: &str| &unit.variables().iter().find(|it| it.name == name).unwrap().description;
        let inferred = "; manual p. 102, 108, 116; inferred: area D-220, name D-150, offset D-150, type D-150, owner D-150";
        assert!(about("baps.a_RD_VALUE[7]").contains(inferred), "{}", about("baps.a_RD_VALUE[7]"));
        assert!(!about("node2.w_CPU_CONTROL").contains("name D-"), "the manual has this name");
    }
}
