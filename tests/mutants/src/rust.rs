//! Mutants of Rust code. All of a file's mutants are compiled in at once, each behind a switch: `a < b` becomes
//! `match (&(a), &(b)) { (l, r) => if crate::mutant(7) { l <= r } else { l < r } }`. So operands are evaluated once, and
//! mutants nest.

use std::{collections::HashSet, ops::Range};

use proc_macro2::Span;
use syn::{
    Arm, Attribute, BinOp, Block, Expr, ExprBinary, ExprIf, ExprMatch, ExprMethodCall, ExprRepeat, ExprUnary,
    ImplItemConst, ItemConst, ItemFn, ItemMod, ItemStatic, Lit, Macro, Pat, Stmt, TraitItemConst, Type, UnOp,
    spanned::Spanned,
    visit::{self, Visit},
};

use crate::Mutant;

/// A change of the text: `range` is replaced.
struct Edit {
    range: Range<usize>,
    /// At one offset, ends of expressions come before beginnings, and these before what is replaced.
    rank: u8,
    text: String,
    mutant: u32,
}

/// A file with its mutants compiled in.
pub struct Mutated {
    pub text: String,
    /// What each mutant covers of `text`.
    pub places: Vec<(u32, Range<usize>)>,
}

/// Finds the mutants of a file, numbered from `first`.
///
/// # Errors
/// A syntax error.
pub fn find(file: &str, text: &str, first: u32) -> syn::Result<(Vec<Mutant>, Edits)> {
    let syntax = syn::parse_file(text)?;
    let mut finder = Finder { file, text, first, mutants: Vec::new(), edits: Vec::new() };
    finder.visit_file(&syntax);
    let Finder { mutants, edits, .. } = finder;
    Ok((mutants, Edits(edits)))
}

/// The changes that compile a file's mutants in.
#[derive(Default)]
pub struct Edits(Vec<Edit>);

impl Edits {
    /// Applies them, without the mutants that do not compile.
    pub fn apply(&self, text: &str, broken: &HashSet<u32>) -> Mutated {
        let mut edits: Vec<&Edit> = self.0.iter().filter(|edit| !broken.contains(&edit.mutant)).collect();
        edits.sort_by_key(|edit| (edit.range.start, edit.rank));
        let (mut out, mut at) = (String::new(), 0);
        let mut places: Vec<(u32, Range<usize>)> = Vec::new();
        for edit in edits {
            out += &text[at..edit.range.start];
            let start = out.len();
            out += &edit.text;
            at = edit.range.end;
            match places.iter_mut().find(|(mutant, _)| *mutant == edit.mutant) {
                Some((_, place)) => place.end = out.len(),
                None => places.push((edit.mutant, start..out.len())),
            }
        }
        out += &text[at..];
        Mutated { text: out, places }
    }
}

struct Finder<'t> {
    file: &'t str,
    text: &'t str,
    first: u32,
    mutants: Vec<Mutant>,
    edits: Vec<Edit>,
}

impl Finder<'_> {
    /// Adds a mutant that turns `from` into `to` at a place of the source. Returns the condition that switches it on.
    fn add(&mut self, span: Span, from: &str, to: &str) -> (u32, String) {
        let id = self.first + self.mutants.len() as u32;
        let start = span.start();
        self.mutants.push(Mutant {
            id,
            file: self.file.to_owned(),
            line: start.line,
            column: start.column + 1,
            change: format!("{from} -> {to}"),
            source: self.text.lines().nth(start.line - 1).unwrap_or_default().trim().to_owned(),
        });
        (id, format!("crate::mutant({id})"))
    }

    fn begin(&mut self, mutant: u32, at: usize, text: impl Into<String>) {
        self.edits.push(Edit { range: at..at, rank: 1, text: text.into(), mutant });
    }

    fn replace(&mut self, mutant: u32, range: Range<usize>, text: impl Into<String>) {
        self.edits.push(Edit { range, rank: 2, text: text.into(), mutant });
    }

    fn end(&mut self, mutant: u32, at: usize, text: impl Into<String>) {
        self.edits.push(Edit { range: at..at, rank: 0, text: text.into(), mutant });
    }
}

/// Whether an item is only there in tests.
fn of_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let path = attribute.path();
        path.is_ident("test")
            || path.is_ident("cfg")
                && attribute.parse_args::<syn::Path>().is_ok_and(|argument| argument.is_ident("test"))
    })
}

/// Whether an expression has a `let` of its own, as in `a && let Some(b) = c`.
fn has_let(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) => has_let(&binary.left) || has_let(&binary.right),
        _ => false,
    }
}

fn swapped(op: &BinOp) -> Option<(&'static str, &'static str)> {
    Some(match op {
        BinOp::Lt(_) => ("<", "<="),
        BinOp::Le(_) => ("<=", "<"),
        BinOp::Gt(_) => (">", ">="),
        BinOp::Ge(_) => (">=", ">"),
        BinOp::Eq(_) => ("==", "!="),
        BinOp::Ne(_) => ("!=", "=="),
        BinOp::Add(_) => ("+", "-"),
        BinOp::Sub(_) => ("-", "+"),
        BinOp::Mul(_) => ("*", "/"),
        BinOp::Div(_) => ("/", "*"),
        BinOp::Rem(_) => ("%", "*"),
        BinOp::BitAnd(_) => ("&", "|"),
        BinOp::BitOr(_) => ("|", "&"),
        BinOp::BitXor(_) => ("^", "&"),
        BinOp::Shl(_) => ("<<", ">>"),
        BinOp::Shr(_) => (">>", "<<"),
        BinOp::And(_) => ("&&", "||"),
        BinOp::Or(_) => ("||", "&&"),
        _ => return None,
    })
}

fn compares(op: &BinOp) -> bool {
    matches!(op, BinOp::Lt(_) | BinOp::Le(_) | BinOp::Gt(_) | BinOp::Ge(_) | BinOp::Eq(_) | BinOp::Ne(_))
}

/// Another number near a literal one.
fn other(literal: &Lit) -> Option<(String, String)> {
    match literal {
        Lit::Int(int) => {
            let value: u128 = int.base10_parse().ok()?;
            let other = if value < 2 { value + 1 } else { value - 1 };
            Some((int.to_string(), format!("{other}{}", int.suffix())))
        }
        Lit::Float(float) => {
            let value: f64 = float.base10_parse().ok()?;
            let other = if value == 0.0 { 1.0 } else { 2.0 * value };
            Some((float.to_string(), format!("{other:?}{}", float.suffix())))
        }
        _ => None,
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    // What is evaluated by the compiler, and what is no expression.
    fn visit_item_const(&mut self, _: &'ast ItemConst) {}
    fn visit_impl_item_const(&mut self, _: &'ast ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast TraitItemConst) {}
    fn visit_item_static(&mut self, _: &'ast ItemStatic) {}
    fn visit_type(&mut self, _: &'ast Type) {}
    fn visit_pat(&mut self, _: &'ast Pat) {}
    fn visit_macro(&mut self, _: &'ast Macro) {}
    fn visit_attribute(&mut self, _: &'ast Attribute) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
    fn visit_variant(&mut self, _: &'ast syn::Variant) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}

    fn visit_expr_repeat(&mut self, repeat: &'ast ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_item_mod(&mut self, module: &'ast ItemMod) {
        if !of_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_item_fn(&mut self, function: &'ast ItemFn) {
        if !of_tests(&function.attrs) && function.sig.constness.is_none() {
            visit::visit_item_fn(self, function);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !of_tests(&function.attrs) && function.sig.constness.is_none() {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_expr_binary(&mut self, binary: &'ast ExprBinary) {
        let change = swapped(&binary.op).filter(|_| !has_let(&binary.left) && !has_let(&binary.right));
        let Some((from, to)) = change else { return visit::visit_expr_binary(self, binary) };
        let [left, right, op] =
            [binary.left.span(), binary.right.span(), binary.op.span()].map(|span| span.byte_range());
        let (id, on) = self.add(binary.op.span(), from, to);
        let logical = matches!(binary.op, BinOp::And(_) | BinOp::Or(_));
        // !(!a && !b) is a || b: the second operand is still evaluated only if it must be.
        let [begin, middle, end] = if logical {
            [format!("({on} ^ (({on} ^ ("), format!(")) {from} ({on} ^ ("), "))))".into()]
        } else {
            let borrow = if compares(&binary.op) { "&" } else { "" };
            let end = format!(")) {{ (l, r) => if {on} {{ l {to} r }} else {{ l {from} r }} }})");
            [format!("(match ({borrow}("), format!("), {borrow}("), end]
        };
        self.begin(id, left.start, begin);
        self.visit_expr(&binary.left);
        // The operator's own token, and no comment around it.
        self.end(id, left.end, "");
        self.replace(id, op, middle);
        self.visit_expr(&binary.right);
        self.end(id, right.end, end);
    }

    fn visit_expr_unary(&mut self, unary: &'ast ExprUnary) {
        let from = match unary.op {
            UnOp::Not(_) => "!",
            UnOp::Neg(_) => "-",
            _ => return visit::visit_expr_unary(self, unary),
        };
        let (id, on) = self.add(unary.op.span(), from, "");
        self.replace(id, unary.op.span().byte_range(), "(match (");
        self.visit_expr(&unary.expr);
        let end = format!(") {{ v => if {on} {{ v }} else {{ {from}v }} }})");
        self.end(id, unary.expr.span().byte_range().end, end);
    }

    fn visit_expr_lit(&mut self, literal: &'ast syn::ExprLit) {
        if let Some((from, to)) = other(&literal.lit) {
            let (id, on) = self.add(literal.span(), &from, &to);
            let text = format!("(if {on} {{ {to} }} else {{ {from} }})");
            self.replace(id, literal.span().byte_range(), text);
        }
    }

    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        let to = match &*call.method.to_string() {
            "min" => "max",
            "max" => "min",
            _ => return visit::visit_expr_method_call(self, call),
        };
        let Some(argument) = call.args.first() else { return visit::visit_expr_method_call(self, call) };
        let [receiver, argument_at] = [call.receiver.span(), argument.span()].map(|span| span.byte_range());
        let (from, (id, on)) =
            (call.method.to_string(), self.add(call.method.span(), &call.method.to_string(), to));
        self.begin(id, receiver.start, "(match ((");
        self.visit_expr(&call.receiver);
        self.replace(id, call.dot_token.span().byte_range().start..argument_at.start, "), (");
        self.visit_expr(argument);
        let end = format!(") ) {{ (l, r) => if {on} {{ l.{to}(r) }} else {{ l.{from}(r) }} }})");
        self.replace(id, argument_at.end..call.paren_token.span.close().byte_range().end, end);
    }

    fn visit_expr_if(&mut self, conditional: &'ast ExprIf) {
        // Comparisons and the like have mutants of their own.
        let plain = matches!(
            &*conditional.cond,
            Expr::Path(_) | Expr::Field(_) | Expr::MethodCall(_) | Expr::Call(_) | Expr::Index(_)
        );
        if plain {
            let at = conditional.cond.span().byte_range();
            let (id, on) = self.add(conditional.cond.span(), "if", "if !");
            self.begin(id, at.start, format!("({on} ^ ("));
            visit::visit_expr_if(self, conditional);
            self.end(id, at.end, "))");
        } else {
            visit::visit_expr_if(self, conditional);
        }
    }

    fn visit_expr_match(&mut self, chosen: &'ast ExprMatch) {
        self.visit_expr(&chosen.expr);
        let is_rest = |arm: &Arm| matches!(arm.pat, Pat::Wild(_)) && arm.guard.is_none();
        let rest = chosen.arms.iter().position(is_rest).unwrap_or(0);
        for (index, arm) in chosen.arms.iter().enumerate() {
            let guard = arm.guard.as_ref().map(|(_, guard)| &**guard);
            if index < rest && guard.is_none_or(|guard| !has_let(guard)) {
                let (id, on) = self.add(arm.pat.span(), "an arm", "none");
                match guard {
                    Some(guard) => {
                        self.begin(id, guard.span().byte_range().start, format!("!{on} && ("));
                        self.visit_expr(guard);
                        self.end(id, guard.span().byte_range().end, ")");
                    }
                    None => self.end(id, arm.pat.span().byte_range().end, format!(" if !{on}")),
                }
            } else if let Some(guard) = guard {
                self.visit_expr(guard);
            }
            self.visit_expr(&arm.body);
        }
    }

    fn visit_block(&mut self, block: &'ast Block) {
        for statement in &block.stmts {
            let acts = matches!(
                statement,
                Stmt::Expr(Expr::Assign(_) | Expr::MethodCall(_) | Expr::Call(_), Some(_))
            ) || matches!(statement, Stmt::Expr(Expr::Binary(binary), Some(_)) if swapped(&binary.op).is_none());
            if acts {
                let at = statement.span().byte_range();
                let (id, on) = self.add(statement.span(), "a statement", "none");
                self.begin(id, at.start, format!("if !{on} {{ "));
                self.visit_stmt(statement);
                self.end(id, at.end, " }");
            } else {
                self.visit_stmt(statement);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text of a function's body with its mutants compiled in, and the mutants' changes.
    fn mutated(body: &str) -> (String, Vec<String>) {
        let text = format!("fn f() {{ {body} }}");
        let (mutants, edits) = find("f.rs", &text, 1).unwrap();
        let mutated = edits.apply(&text, &HashSet::new()).text;
        syn::parse_file(&mutated).unwrap_or_else(|error| panic!("{error}: {mutated}"));
        let inside = mutated.strip_prefix("fn f() { ").unwrap().strip_suffix(" }").unwrap();
        (inside.to_owned(), mutants.into_iter().map(|mutant| mutant.change).collect())
    }

    #[test]
    fn operands_are_evaluated_once() {
        let (text, changes) = mutated("a() < b()");
        assert_eq!(changes, ["< -> <="]);
        assert_eq!(text.matches("a()").count(), 1);
        assert_eq!(
            text,
            "(match (&(a() ), &( b())) { (l, r) => if crate::mutant(1) { l <= r } else { l < r } })"
        );
    }

    #[test]
    fn mutants_nest_and_can_be_left_out() {
        let text = "fn f() { a + b * 2 }";
        let (mutants, edits) = find("f.rs", text, 10).unwrap();
        let changes: Vec<_> = mutants.iter().map(|mutant| (mutant.id, mutant.change.as_str())).collect();
        assert_eq!(changes, [(10, "+ -> -"), (11, "* -> /"), (12, "2 -> 1")]);
        let all = edits.apply(text, &HashSet::new());
        syn::parse_file(&all.text).unwrap();
        assert_eq!(edits.apply(text, &HashSet::from([10, 11, 12])).text, text);
        // The innermost place that contains an error names the mutant to leave out.
        let [outer, inner, literal] = [0, 1, 2].map(|i| all.places[i].clone());
        assert!(outer.1.start < inner.1.start && inner.1.end < outer.1.end, "{outer:?} {inner:?}");
        assert_eq!(&all.text[literal.1.clone()], "(if crate::mutant(12) { 1 } else { 2 })");
    }

    #[test]
    fn every_kind_of_change() {
        for (body, expected) in [
            ("a && b", vec!["&& -> ||"]),
            ("a && let Some(b) = c", vec![]),
            ("!a", vec!["! -> "]),
            ("!a && -1 < b", vec!["&& -> ||", "! -> ", "< -> <=", "- -> ", "1 -> 2"]),
            ("-a", vec!["- -> "]),
            ("a.min(b)", vec!["min -> max"]),
            ("a.iter().max()", vec![]),
            ("if a { b } else { c }", vec!["if -> if !"]),
            ("match a { 1 => b, _ => c }", vec!["an arm -> none"]),
            ("match a { 1 if b => c, _ => d }", vec!["an arm -> none"]),
            ("a(b);", vec!["a statement -> none"]),
            ("a += b;", vec!["a statement -> none"]),
            ("let a = 0.0; let b = 7u8;", vec!["0.0 -> 1.0", "7u8 -> 6u8"]),
            ("const A: u32 = 1; let b: [u8; 2] = [c; 2];", vec![]),
            ("assert!(a < b);", vec![]),
        ] {
            let (_, changes) = mutated(body);
            assert_eq!(changes, expected, "{body}");
        }
        assert!(find("f.rs", "#[cfg(test)] mod tests { fn f() { 1 + 1; } }", 1).unwrap().0.is_empty());
    }
}
