//! Imports of a script. They are other scripts of the folder. Their texts were read together with the main
//! script.

use super::Files;
use crate::whole_script;
use core::cell::RefCell;
use rhai::{Engine, EvalAltResult, Module, ModuleResolver, Position, Scope};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Finds the modules of a script in its folder.
pub(super) struct Imports {
    files: Files,
    modules: RefCell<BTreeMap<String, Rc<Module>>>,
    /// Files that are being imported. The first entry is the file that has imported the second, and so on.
    under_way: RefCell<Vec<String>>,
}

impl Imports {
    pub(super) fn new(files: &Files) -> Self {
        Imports { files: Files::clone(files), modules: RefCell::default(), under_way: RefCell::default() }
    }
}

impl ModuleResolver for Imports {
    fn resolve(
        &self,
        engine: &Engine,
        _: Option<&str>,
        path: &str,
        position: Position,
    ) -> Result<Rc<Module>, Box<EvalAltResult>> {
        let name = path.strip_suffix(".rhai").unwrap_or(path);
        let is_file = |(file, _): &&(String, String)| file.strip_suffix(".rhai") == Some(name);
        let Some((file, text)) = self.files.iter().skip(1).find(is_file) else {
            return Err(EvalAltResult::ErrorModuleNotFound(path.to_owned(), position).into());
        };
        if let Some(known) = self.modules.borrow().get(file.as_str()) {
            return Ok(Rc::clone(known));
        }
        if self.under_way.borrow().contains(file) {
            let circle = format!("the import of {file} is circular");
            return Err(EvalAltResult::ErrorRuntime(circle.into(), position).into());
        }
        self.under_way.borrow_mut().push(file.clone());
        let module = module(engine, file, text);
        self.under_way.borrow_mut().pop();
        let module = module.map_err(|error| EvalAltResult::ErrorInModule(file.clone(), error, position))?;
        self.modules.borrow_mut().insert(file.clone(), Rc::clone(&module));
        Ok(module)
    }
}

fn module(engine: &Engine, file: &str, text: &str) -> Result<Rc<Module>, Box<EvalAltResult>> {
    let mut script = whole_script::compile(engine, text)?;
    script.set_source(file);
    Ok(Module::eval_ast_as_new(Scope::new(), &script, engine)?.into())
}
