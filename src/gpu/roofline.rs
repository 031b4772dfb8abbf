//! What a stage moves and computes, read off its composed shader: which arrays it reads and writes, and how many floating-point operations a
//! thread makes (Williams, Waterman, Patterson 2009, Commun. ACM 52:65: the roofline).

use std::collections::BTreeMap;

use naga::valid::{Capabilities, FunctionInfo, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use naga::{BinaryOperator, Block, Expression, Function, Handle, Literal, MathFunction, Module, Statement, TypeInner};

use super::arrays::STEP_INPUT;
use super::compose::Defines;
use super::engine::GpuEngine;
use super::kernel::{Kernel, MeshNumbers, reflect};
use super::plan::{Features, defines, mesh_numbers};
use super::structs::StepInput;
use crate::engine::Stage;
use crate::error::{Error, Result};

/// What one thread of a stage does, and what all of them touch.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Work {
    /// Arrays of which it reads, and those that it writes, by the names of their variables.
    pub read: Vec<String>,
    pub written: Vec<String>,
    /// Floating-point operations of a thread: a multiplication and an addition are two, a root, a power and an exponential one each. Of two
    /// branches the longer one counts.
    pub flops: f64,
    /// Some loops have as many rounds as the data say, and count once: there may be more.
    pub at_least: bool,
}

/// What a stage moves and computes in one dispatch, see [`Work`].
#[derive(Debug, Clone, PartialEq)]
pub struct StageLoad {
    pub stage: Stage,
    pub threads: u32,
    /// Sizes of the arrays that it reads and of those that it writes [B].
    pub bytes: f64,
    /// It goes through the whole mesh, so that it moves these bytes; else it touches a part of them.
    pub whole: bool,
    pub flops: f64,
    /// There may be more of them, see [`Work::at_least`].
    pub at_least: bool,
}

impl GpuEngine {
    /// What every stage moves and computes in one dispatch: arrays once each, whole.
    ///
    /// # Errors
    /// `Error::Shader`, where a source has changed since.
    pub fn loads(&self) -> Result<Vec<StageLoad>> {
        let model = &*self.model;
        let features = Features { wide: self.grain.wide, ..Features::of(model) };
        let defines = defines(&model.effects, &features);
        let numbers = mesh_numbers(model, &self.layout, self.grain);
        let bytes = |names: &[String]| -> f64 {
            let size = |name: &String| match name.as_str() {
                // A step reads its own.
                STEP_INPUT => size_of::<StepInput>() as f64,
                name => self.buffers.get(name).map_or(0.0, |memory| memory.device_bytes() as f64),
            };
            names.iter().map(size).sum()
        };
        let load = |kernel: &Kernel| {
            let threads = f64::from(kernel.threads());
            // A thread has a strip of cells.
            let rounds = match kernel.stage {
                Stage::ElementForces => (model.mesh.cell_count() as f64 / threads).max(1.0),
                _ => 1.0,
            };
            let work = work(kernel.stage, &defines, &numbers, rounds)?;
            Ok(StageLoad {
                stage: kernel.stage,
                threads: kernel.threads(),
                bytes: bytes(&work.read) + bytes(&work.written),
                whole: threads * rounds >= model.mesh.cell_count().min(model.mesh.node_count()) as f64,
                flops: work.flops * threads,
                at_least: work.at_least,
            })
        };
        self.kernels.iter().filter(|k| !k.stage.draws()).map(load).collect()
    }
}

/// The work of a stage with these defines on a mesh with these numbers. `rounds`: how often a thread goes through the outermost loop that the
/// data bound, such as the layers of a column.
///
/// # Errors
/// `Error::Shader`, as for the stage itself.
pub fn work(stage: Stage, defines: &Defines, numbers: &MeshNumbers, rounds: f64) -> Result<Work> {
    let module = reflect(stage, defines, false)?.module;
    let fail = |message: String| Error::Shader { stage: stage.name().into(), message };
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|error| fail(error.to_string()))?;
    let entry = module.entry_points.iter().position(|e| e.name == stage.name());
    let entry = entry.ok_or_else(|| fail("no entry point of that name".into()))?;
    let used = info.get_entry_point(entry);
    let touched = |how: GlobalUse| -> Vec<String> {
        let bound = module.global_variables.iter().filter(|(_, variable)| variable.binding.is_some());
        bound.filter(|(global, _)| used[*global].contains(how)).filter_map(|(_, v)| v.name.clone()).collect()
    };
    let mut count = Count { module: &module, info: &info, numbers, known: BTreeMap::new(), at_least: false, rounds };
    let flops =
        count.block(&module.entry_points[entry].function, used, &module.entry_points[entry].function.body, true);
    Ok(Work { read: touched(GlobalUse::READ), written: touched(GlobalUse::WRITE), flops, at_least: count.at_least })
}

struct Count<'a> {
    module: &'a Module,
    info: &'a ModuleInfo,
    numbers: &'a MeshNumbers,
    known: BTreeMap<usize, f64>,
    at_least: bool,
    rounds: f64,
}

impl Count<'_> {
    fn function(&mut self, handle: Handle<Function>) -> f64 {
        if let Some(known) = self.known.get(&handle.index()) {
            return *known;
        }
        let (module, info) = (self.module, self.info);
        let flops = self.block(&module.functions[handle], &info[handle], &module.functions[handle].body, false);
        self.known.insert(handle.index(), flops);
        flops
    }

    fn block(&mut self, of: &Function, info: &FunctionInfo, block: &Block, outermost: bool) -> f64 {
        let mut sum = 0.0;
        for statement in block.iter() {
            sum += match statement {
                Statement::Emit(range) => range.clone().map(|e| self.expression(of, info, e)).sum(),
                Statement::Block(inner) => self.block(of, info, inner, outermost),
                Statement::If { accept, reject, .. } => {
                    self.block(of, info, accept, outermost).max(self.block(of, info, reject, outermost))
                }
                Statement::Switch { cases, .. } => {
                    cases.iter().map(|case| self.block(of, info, &case.body, outermost)).fold(0.0, f64::max)
                }
                Statement::Loop { body, continuing, .. } => {
                    let rounds = match self.rounds_of(of, body) {
                        Some(rounds) => rounds,
                        None if outermost && self.rounds > 1.0 => self.rounds,
                        None => {
                            self.at_least = true;
                            1.0
                        }
                    };
                    let inner = outermost && rounds != self.rounds;
                    rounds * (self.block(of, info, body, inner) + self.block(of, info, continuing, inner))
                }
                Statement::Call { function, .. } => self.function(*function),
                _ => 0.0,
            };
        }
        sum
    }

    /// Rounds of a loop that counts up to a number; `None` where the data say how many. A loop that runs once or not at all counts once.
    fn rounds_of(&self, of: &Function, body: &Block) -> Option<f64> {
        let condition = body.iter().find_map(|statement| match statement {
            Statement::If { condition, accept, reject } => {
                let leaves = |block: &Block| matches!(block.first(), Some(Statement::Break));
                (leaves(accept) || leaves(reject)).then_some(*condition)
            }
            _ => None,
        })?;
        let (op, right) = self.comparison(of, condition)?;
        let bound = self.number(of, right)?;
        match op {
            BinaryOperator::Equal => Some(1.0),
            BinaryOperator::Less => Some(bound),
            BinaryOperator::LessEqual => Some(bound + 1.0),
            _ => None,
        }
    }

    /// The comparison in a condition, without negations and other conditions that it is joined with.
    fn comparison(&self, of: &Function, condition: Handle<Expression>) -> Option<(BinaryOperator, Handle<Expression>)> {
        match of.expressions[condition] {
            Expression::Unary { expr, .. } => self.comparison(of, expr),
            Expression::Binary { op: BinaryOperator::LogicalAnd | BinaryOperator::LogicalOr, left, right } => {
                self.comparison(of, right).or_else(|| self.comparison(of, left))
            }
            Expression::Binary { op, right, .. } => Some((op, right)),
            _ => None,
        }
    }

    fn number(&self, of: &Function, at: Handle<Expression>) -> Option<f64> {
        let literal = |value: &Expression| match value {
            Expression::Literal(Literal::U32(n)) => Some(f64::from(*n)),
            Expression::Literal(Literal::I32(n)) => Some(f64::from(*n)),
            _ => None,
        };
        match &of.expressions[at] {
            Expression::Constant(constant) => {
                literal(&self.module.global_expressions[self.module.constants[*constant].init])
            }
            Expression::Override(open) => {
                let name = self.module.overrides[*open].name.as_deref()?;
                self.numbers.get(name).map(|n| f64::from(*n))
            }
            other => literal(other),
        }
    }

    /// Floating-point operations of one expression.
    fn expression(&self, of: &Function, info: &FunctionInfo, at: Handle<Expression>) -> f64 {
        let inner = |e: Handle<Expression>| info[e].ty.inner_with(&self.module.types);
        match of.expressions[at] {
            Expression::Binary { op, left, right } => {
                let counted = matches!(
                    op,
                    BinaryOperator::Add | BinaryOperator::Subtract | BinaryOperator::Multiply | BinaryOperator::Divide
                );
                if !counted || !is_real(inner(at)) {
                    return 0.0;
                }
                // Of a product of matrices or of a matrix and a vector every component is a sum of as many products as a row is long.
                let terms = match (op, inner(left), inner(right)) {
                    (BinaryOperator::Multiply, TypeInner::Matrix { columns, .. }, r) if !is_scalar(r) => *columns as u8,
                    (BinaryOperator::Multiply, TypeInner::Vector { size, .. }, TypeInner::Matrix { .. }) => *size as u8,
                    _ => 1,
                };
                components(inner(at)) * (2.0 * f64::from(terms) - 1.0)
            }
            Expression::Unary { op: naga::UnaryOperator::Negate, .. } if is_real(inner(at)) => components(inner(at)),
            Expression::Math { fun, arg, .. } if is_real(inner(arg)) => {
                let n = components(inner(arg));
                match fun {
                    MathFunction::Dot => 2.0 * n - 1.0,
                    MathFunction::Cross => 9.0,
                    MathFunction::Length => 2.0 * n,
                    MathFunction::Distance | MathFunction::Normalize => 3.0 * n,
                    MathFunction::Fma => 2.0 * n,
                    MathFunction::Mix => 3.0 * n,
                    // Cofactors and products of a matrix of three rows.
                    MathFunction::Determinant => 14.0,
                    MathFunction::Transpose => 0.0,
                    _ => n,
                }
            }
            _ => 0.0,
        }
    }
}

fn is_real(inner: &TypeInner) -> bool {
    matches!(
        inner,
        TypeInner::Scalar(naga::Scalar { kind: naga::ScalarKind::Float, .. })
            | TypeInner::Vector { scalar: naga::Scalar { kind: naga::ScalarKind::Float, .. }, .. }
            | TypeInner::Matrix { .. }
    )
}

fn is_scalar(inner: &TypeInner) -> bool {
    matches!(inner, TypeInner::Scalar(_))
}

fn components(inner: &TypeInner) -> f64 {
    match inner {
        TypeInner::Vector { size, .. } => f64::from(*size as u8),
        TypeInner::Matrix { columns, rows, .. } => f64::from(*columns as u8) * f64::from(*rows as u8),
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(body: &str) -> (f64, bool) {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> x: array<vec4f>; \
             fn twice(v: vec4f) -> vec4f {{ return v + v; }} \
             @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{ let i = id.x; {body} }}"
        );
        let module = naga::front::wgsl::parse_str(&source).unwrap();
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).unwrap();
        let numbers = MeshNumbers::new();
        let mut count = Count {
            module: &module,
            info: &info,
            numbers: &numbers,
            known: BTreeMap::new(),
            at_least: false,
            rounds: 5.0,
        };
        let function = &module.entry_points[0].function;
        (count.block(function, info.get_entry_point(0), &function.body, true), count.at_least)
    }

    #[test]
    fn operations_are_counted() {
        assert_eq!(counted("x[i] = x[i] * 2.0 + x[i];"), (8.0, false));
        assert_eq!(counted("x[i].x = dot(x[i].xyz, x[i].xyz);"), (5.0, false));
        assert_eq!(counted("let m = mat3x3f(x[0].xyz, x[1].xyz, x[2].xyz); x[i].x = (m * x[i].xyz).x;"), (15.0, false));
        assert_eq!(counted("let m = mat3x3f(x[0].xyz, x[1].xyz, x[2].xyz); x[i].x = (m * m)[0].x;"), (45.0, false));
        assert_eq!(counted("x[i] = twice(twice(x[i]));"), (8.0, false));
        // Integers are no floating-point numbers.
        assert_eq!(counted("x[i * 3u + 1u].x = sqrt(x[i].x);"), (1.0, false));
    }

    #[test]
    fn loops_and_branches() {
        assert_eq!(counted("for (var k = 0u; k < 8u; k++) { x[k] = x[k] + x[i]; }"), (32.0, false));
        assert_eq!(counted("if i < 3u { x[i] = x[i] + x[0]; } else { x[i].x = x[i].x + 1.0; }"), (4.0, false));
        assert_eq!(
            counted("for (var once = select(1u, 0u, i > 3u); once == 0u; once++) { x[i].x = x[i].x + 1.0; }"),
            (1.0, false)
        );
        // Data say how many rounds: those that the caller knows outside, one and a remark inside.
        let outer = "for (var k = 0u; k < arrayLength(&x); k++) { x[k].x = x[k].x + 1.0; }";
        assert_eq!(counted(outer), (5.0, false));
        let inner = "for (var k = 0u; k < i; k++) { for (var l = 0u; l < k; l++) { x[k].x = x[l].x + 1.0; } }";
        assert_eq!(counted(inner), (5.0, true));
    }
}
