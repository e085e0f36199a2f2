//! Conditions that drop points: `frequency < 500 and Kd * Delta < 50`.
//!
//! ```text
//! condition  = both { "or" both }
//! both       = comparison { "and" comparison }
//! comparison = sum ( "<" | "<=" | ">" | ">=" | "==" | "!=" ) sum | "(" condition ")"
//! sum        = product { ( "+" | "-" ) product }
//! product    = factor { ( "*" | "/" ) factor }
//! factor     = "-" factor | number | quantity | "(" sum ")"
//! ```
//!
//! Quantities are the keys of the parameters, `eta` and `frequency`, in SI. Without modulation `eta` and `frequency` are
//! 0 and `T` is infinite. A comparison with something undefined, such as 0/0, does not hold. Read by operator precedence
//! (V. R. Pratt, POPL 1973).

use super::quantity::{Point, Quantity};
use super::source::hint;
use std::cmp::Ordering;

/// Most words and signs of a condition: it is read and evaluated by recursion.
const MAX_TOKENS: usize = 500;

#[derive(Clone, Debug)]
pub(super) struct Condition(Expression);

/// A condition or a number. Reading makes sure that each stands where it may.
#[derive(Clone, Debug)]
enum Expression {
    Constant(f64),
    Quantity(Quantity),
    Negative(Box<Self>),
    Combined(Box<(Self, Operator, Self)>),
}

#[derive(Clone, Copy, Debug)]
struct Operator {
    sign: &'static str,
    /// What binds closer has a larger one.
    precedence: u8,
    /// The value; that of a condition is 1 if it holds, otherwise 0.
    combine: fn(f64, f64) -> f64,
}

/// Precedence of conditions between conditions, and of comparisons: below and above are conditions and numbers.
const OR: u8 = 1;
const AND: u8 = 2;
const COMPARISON: u8 = 3;
const SUM: u8 = 4;
const PRODUCT: u8 = 5;

const OPERATORS: [Operator; 12] = [
    Operator { sign: "or", precedence: OR, combine: f64::max },
    Operator { sign: "and", precedence: AND, combine: f64::min },
    Operator { sign: "<", precedence: COMPARISON, combine: |a, b| f64::from(a < b) },
    Operator { sign: "<=", precedence: COMPARISON, combine: |a, b| f64::from(a <= b) },
    Operator { sign: ">", precedence: COMPARISON, combine: |a, b| f64::from(a > b) },
    Operator { sign: ">=", precedence: COMPARISON, combine: |a, b| f64::from(a >= b) },
    Operator { sign: "==", precedence: COMPARISON, combine: |a, b| f64::from(a == b) },
    // Not `a != b`, which holds for what is no number.
    Operator {
        sign: "!=",
        precedence: COMPARISON,
        combine: |a, b| f64::from(a.partial_cmp(&b).is_some_and(Ordering::is_ne)),
    },
    Operator { sign: "+", precedence: SUM, combine: |a, b| a + b },
    Operator { sign: "-", precedence: SUM, combine: |a, b| a - b },
    Operator { sign: "*", precedence: PRODUCT, combine: |a, b| a * b },
    Operator { sign: "/", precedence: PRODUCT, combine: |a, b| a / b },
];

/// What is wrong with a condition, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("at character {position}: {problem}")]
pub(super) struct ConditionError {
    /// Character of the condition, counted from 1.
    pub position: usize,
    pub problem: String,
}

impl Condition {
    pub fn parse(text: &str) -> Result<Self, ConditionError> {
        let tokens = tokens(text)?;
        let mut reader = Reader { tokens: &tokens, next: 0, end: text.chars().count() + 1 };
        let start = reader.position();
        let expression = reader.expression(OR)?;
        if reader.next < tokens.len() {
            let found = reader.peek();
            return Err(reader.error(format!("\"{found}\" is not expected here; join conditions by and, or")));
        }
        expression.demanded(true, start).map(Self)
    }

    /// Whether it names a quantity of a kind.
    pub fn names(&self, is_meant: impl Fn(Quantity) -> bool) -> bool {
        self.0.names(&is_meant)
    }

    /// Whether a canonical point fulfils it.
    pub fn holds(&self, point: &Point) -> bool {
        self.0.evaluate(point) == 1.0
    }
}

impl Expression {
    fn evaluate(&self, point: &Point) -> f64 {
        match self {
            Self::Constant(constant) => *constant,
            Self::Quantity(quantity) => point.number(*quantity),
            Self::Negative(number) => -number.evaluate(point),
            Self::Combined(combined) => {
                let (left, operator, right) = &**combined;
                (operator.combine)(left.evaluate(point), right.evaluate(point))
            }
        }
    }

    fn names(&self, is_meant: &dyn Fn(Quantity) -> bool) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Quantity(quantity) => is_meant(*quantity),
            Self::Negative(number) => number.names(is_meant),
            Self::Combined(combined) => combined.0.names(is_meant) || combined.2.names(is_meant),
        }
    }

    /// This expression, which starts at `position`, where a condition or a number is needed.
    fn demanded(self, condition: bool, position: usize) -> Result<Self, ConditionError> {
        let is_condition = matches!(&self, Self::Combined(combined) if combined.1.precedence <= COMPARISON);
        let problem = match (condition, is_condition) {
            (true, false) => "a comparison is needed here, such as frequency < 500",
            (false, true) => "a number is needed here, this is a condition; join conditions by and, or",
            _ => return Ok(self),
        };
        Err(ConditionError { position, problem: problem.to_owned() })
    }
}

struct Token {
    /// Character of the condition, counted from 1.
    position: usize,
    text: String,
}

fn tokens(text: &str) -> Result<Vec<Token>, ConditionError> {
    let characters: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let mut next = 0;
    while let Some(&character) = characters.get(next) {
        let start = next;
        next += 1;
        match character {
            _ if character.is_whitespace() => continue,
            'a'..='z' | 'A'..='Z' | '0'..='9' | '_' | '.' => {
                let is_number = !character.is_ascii_alphabetic();
                while characters.get(next).is_some_and(|&c| match c {
                    '+' | '-' => is_number && matches!(characters[next - 1], 'e' | 'E'),
                    _ => c.is_ascii_alphanumeric() || c == '_' || c == '.',
                }) {
                    next += 1;
                }
            }
            '<' | '>' | '=' | '!' => next += usize::from(characters.get(next) == Some(&'=')),
            '+' | '-' | '*' | '/' | '(' | ')' => {}
            other => {
                let problem = format!(
                    "\"{other}\" has no meaning here; allowed are keys, numbers, + - * / ( ), < <= > >= == !=, and, or"
                );
                return Err(ConditionError { position: next, problem });
            }
        }
        tokens.push(Token { position: start + 1, text: characters[start..next].iter().collect() });
        if tokens.len() > MAX_TOKENS {
            let problem = format!("more than {MAX_TOKENS} words and signs; split it into a list of conditions");
            return Err(ConditionError { position: start + 1, problem });
        }
    }
    Ok(tokens)
}

struct Reader<'a> {
    tokens: &'a [Token],
    next: usize,
    /// Position just after the last character.
    end: usize,
}

impl Reader<'_> {
    fn position(&self) -> usize {
        self.tokens.get(self.next).map_or(self.end, |token| token.position)
    }

    fn error(&self, problem: impl Into<String>) -> ConditionError {
        ConditionError { position: self.position(), problem: problem.into() }
    }

    fn peek(&self) -> &str {
        self.tokens.get(self.next).map_or("", |token| token.text.as_str())
    }

    fn accept(&mut self, text: &str) -> bool {
        let found = self.peek() == text;
        self.next += usize::from(found);
        found
    }

    fn operator(&self) -> Option<Operator> {
        OPERATORS.into_iter().find(|operator| operator.sign == self.peek())
    }

    /// Reads an expression whose operators have at least this precedence.
    fn expression(&mut self, min: u8) -> Result<Expression, ConditionError> {
        let start = self.position();
        let mut left = self.factor()?;
        while let Some(operator) = self.operator().filter(|operator| operator.precedence >= min) {
            let joins_conditions = operator.precedence < COMPARISON;
            let demanded = left.demanded(joins_conditions, start)?;
            self.next += 1;
            let position = self.position();
            let right = self.expression(operator.precedence + 1)?.demanded(joins_conditions, position)?;
            left = Expression::Combined(Box::new((demanded, operator, right)));
            if [operator.precedence, self.operator().map_or(0, |next| next.precedence)] == [COMPARISON; 2] {
                return Err(self.error("a second comparison; write a < b and b < c instead of a < b < c"));
            }
        }
        if matches!(self.peek(), "=" | "!") {
            return Err(self.error(format!("write {0}= instead of {0}", self.peek())));
        }
        Ok(left)
    }

    fn factor(&mut self) -> Result<Expression, ConditionError> {
        if self.accept("-") {
            let start = self.position();
            return Ok(Expression::Negative(Box::new(self.factor()?.demanded(false, start)?)));
        }
        if self.accept("(") {
            let inside = self.expression(OR)?;
            return if self.accept(")") { Ok(inside) } else { Err(self.error("a closing ) is missing")) };
        }
        let text = self.peek();
        let expression = match text.chars().next() {
            None => return Err(self.error("the condition ends too early; a key or a number is needed")),
            Some('0'..='9' | '.') => match text.parse() {
                Ok(constant) if f64::is_finite(constant) => Expression::Constant(constant),
                _ => return Err(self.error(format!("\"{text}\" is not a number"))),
            },
            Some('a'..='z' | 'A'..='Z' | '_') => match Quantity::from_key(text) {
                Some(Quantity::BREAK_ON) => {
                    return Err(self.error("break_on is a word and cannot be compared; choose its values on an axis"));
                }
                Some(quantity) => Expression::Quantity(quantity),
                None => {
                    let numbers = Quantity::all().filter(|quantity| *quantity != Quantity::BREAK_ON);
                    let hint = hint(text, &numbers.map(Quantity::key).collect::<Vec<_>>());
                    return Err(self.error(format!("\"{text}\" is not a known quantity; {hint}")));
                }
            },
            Some(_) => return Err(self.error(format!("\"{text}\" is not expected here; a key or a number is needed"))),
        };
        self.next += 1;
        Ok(expression)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;

    fn holds(text: &str) -> bool {
        let parameters = Parameters { modulation_amplitude: 1e-6, ..Parameters::default() };
        let point = Point { parameters, fixes_period: Some((Quantity::Frequency, 49.0)) }.canonical();
        Condition::parse(text).unwrap_or_else(|error| panic!("{text}: {error}")).holds(&point)
    }

    #[test]
    fn products_bind_before_sums_before_comparisons_before_and_before_or() {
        for (text, expected) in [
            ("1 + 2 * 3 == 7", true),
            ("(1 + 2) * 3 == 9", true),
            ("8 / 2 / 2 == 2 and 8 - 2 - 2 == 4", true),
            ("1 < 2 or 1 < 0 and 1 < 0", true),
            ("(1 < 2 or 1 < 0) and 1 < 0", false),
            ("((N) - -10) / 4. == 2e1", true),
            ("N >= 70 and N <= 70 and Ns != 19", true),
            ("Kd * Delta < 50 and Kd*Delta>39.9", true),
            ("0 / 0 != 1", false),
        ] {
            assert_eq!(holds(text), expected, "{text}");
        }
    }

    #[test]
    fn what_an_axis_set_is_compared_as_it_was_set() {
        // 1/(1/49) is not 49.
        assert!(holds("frequency == 49"));
        assert!(holds("T == 1/49"));
    }

    #[test]
    fn without_modulation_eta_and_the_frequency_are_zero() {
        let point = Point { parameters: Parameters::default(), fixes_period: Some((Quantity::Eta, 3.0)) }.canonical();
        for text in ["eta == 0", "frequency == 0", "T > 1e300"] {
            assert!(Condition::parse(text).unwrap().holds(&point), "{text}");
        }
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (text, position, words) in [
            ("frequency < 5OO", 13, "not a number"),
            ("freqency < 500", 1, "did you mean frequency"),
            ("frequency", 1, "comparison is needed"),
            ("T = 1", 3, "=="),
            ("1 < T < 2", 7, "a < b and b < c"),
            ("(T < 1", 7, "closing )"),
            ("T < 1)", 6, "not expected"),
            ("T < 1 T > 0", 7, "and, or"),
            ("T <", 4, "too early"),
            ("", 1, "too early"),
            ("T & 1", 3, "no meaning"),
            ("break_on == 1", 1, "cannot be compared"),
            ("(T < 1) + 1 > 2", 1, "a number is needed"),
            ("T < 1 and 3", 11, "comparison is needed"),
            ("T < 1e999", 5, "not a number"),
            ("\u{3c4} < 1", 1, "no meaning"),
        ] {
            let error = Condition::parse(text).expect_err(text);
            assert_eq!(error.position, position, "{text}: {error}");
            assert!(error.problem.contains(words), "{text}: {error}");
        }
        let deep = "(".repeat(100_000);
        assert!(Condition::parse(&deep).unwrap_err().problem.contains("more than 500"));
    }
}
