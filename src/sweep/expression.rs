//! Conditions and formulas over named numbers: `frequency < 500 and Kd * Delta < 50`, `tau_sd / tau_mean`.
//!
//! ```text
//! condition  = both { "or" both }
//! both       = comparison { "and" comparison }
//! comparison = sum ( "<" | "<=" | ">" | ">=" | "==" | "!=" ) sum | "(" condition ")"
//! sum        = product { ( "+" | "-" ) product }
//! product    = factor { ( "*" | "/" ) factor }
//! factor     = "-" factor | number | name | [ "sqrt" ] "(" sum ")"
//! ```
//!
//! Numbers are equal if twelve digits of them are. A comparison with something undefined, such as 0/0, does not hold.
//! Names of the conditions of a sweep are the keys of the parameters, `eta` and `frequency`, in SI. Read by operator
//! precedence (V. R. Pratt, POPL 1973).

use std::array;

/// Most words and signs of a condition: it is read and evaluated by recursion.
const MAX_WORDS: usize = 500;

/// A condition or a number, over names of type `N`. Reading makes sure that each stands where it may.
#[derive(Clone, Debug)]
pub enum Expression<N> {
    Constant(f64),
    Name(N),
    Negative(Box<Self>),
    Root(Box<Self>),
    Combined(Box<(Self, Operator, Self)>),
}

#[derive(Clone, Copy, Debug)]
pub struct Operator {
    sign: &'static str,
    /// What binds closer has a larger one.
    precedence: u8,
    /// The value; that of a condition is 1 if it holds, otherwise 0.
    combine: fn(f64, f64) -> f64,
}

/// Precedences. Operators below [`COMPARISON`] join conditions; those above it join numbers.
const OR: u8 = 1;
const AND: u8 = 2;
const COMPARISON: u8 = 3;
const SUM: u8 = 4;
const PRODUCT: u8 = 5;

const fn operator(sign: &'static str, precedence: u8, combine: fn(f64, f64) -> f64) -> Operator {
    Operator {
        sign,
        precedence,
        combine,
    }
}

const OPERATORS: [Operator; 12] = [
    operator("or", OR, f64::max),
    operator("and", AND, f64::min),
    operator("<", COMPARISON, |a, b| f64::from(a < b)),
    operator("<=", COMPARISON, |a, b| f64::from(a <= b)),
    operator(">", COMPARISON, |a, b| f64::from(a > b)),
    operator(">=", COMPARISON, |a, b| f64::from(a >= b)),
    operator("==", COMPARISON, |a, b| f64::from(is_equal(a, b))),
    // Undefined numbers neither equal others nor differ from them.
    operator("!=", COMPARISON, |a, b| {
        f64::from(a.partial_cmp(&b).is_some() && !is_equal(a, b))
    }),
    operator("+", SUM, |a, b| a + b),
    operator("-", SUM, |a, b| a - b),
    operator("*", PRODUCT, |a, b| a * b),
    operator("/", PRODUCT, |a, b| a / b),
];

/// Half of the twelfth digit, relative to a number that begins with 1.
const TWELVE_DIGITS: f64 = 5e-12;

fn is_equal(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= TWELVE_DIGITS * a.abs().max(b.abs())
}

/// Names are keys, or headings such as ⟨τ⟩ and V₀.
fn is_of_name(letter: char) -> bool {
    letter.is_alphanumeric() || "_.⟨⟩".contains(letter)
}

/// An error: what is wrong at a character of the text, counted from 1.
fn at(position: usize, problem: &str) -> String {
    format!("at character {position}: {problem}")
}

/// What a name means, or what is wrong with it.
type Meanings<'a, N> = &'a dyn Fn(&str) -> Result<N, String>;

impl<N> Expression<N> {
    pub fn condition(text: &str, names: Meanings<'_, N>) -> Result<Self, String> {
        Self::parse(text, names, true)
    }

    pub fn formula(text: &str, names: Meanings<'_, N>) -> Result<Self, String> {
        Self::parse(text, names, false)
    }

    fn parse(text: &str, names: Meanings<'_, N>, is_condition: bool) -> Result<Self, String> {
        let mut reader = Reader {
            text,
            next: text.len() - text.trim_start().len(),
            words: 0,
            names,
        };
        let start = reader.position();
        let expression = reader.expression(OR)?;
        match reader.peek() {
            "" => expression.demanded(is_condition, start),
            found => Err(reader.error(format!(
                "\"{found}\" is not expected here; join conditions by and, or"
            ))),
        }
    }

    /// The number, with these values of the names; 1 of a condition that holds.
    pub fn evaluate(&self, value: &dyn Fn(&N) -> f64) -> f64 {
        match self {
            Self::Constant(constant) => *constant,
            Self::Name(name) => value(name),
            Self::Negative(number) => -number.evaluate(value),
            Self::Root(number) => number.evaluate(value).sqrt(),
            Self::Combined(combined) => {
                let (left, operator, right) = &**combined;
                (operator.combine)(left.evaluate(value), right.evaluate(value))
            }
        }
    }

    /// The exponents of the base units of the number, with these of the names; `None` if it adds unlike units.
    pub fn exponents<const UNITS: usize>(
        &self,
        of: &dyn Fn(&N) -> Option<[f64; UNITS]>,
    ) -> Option<[f64; UNITS]> {
        match self {
            Self::Constant(_) => Some([0.0; UNITS]),
            Self::Name(name) => of(name),
            Self::Negative(number) => number.exponents(of),
            Self::Root(number) => Some(number.exponents(of)?.map(|exponent| 0.5 * exponent)),
            Self::Combined(combined) => {
                let (left, operator, right) = &**combined;
                let of_left = left.exponents(of)?;
                let of_right = right.exponents(of)?;
                let product =
                    |sign: f64| array::from_fn(|unit| of_left[unit] + sign * of_right[unit]);
                match operator.sign {
                    "*" => Some(product(1.0)),
                    "/" => Some(product(-1.0)),
                    _ => (of_left == of_right).then_some(of_left),
                }
            }
        }
    }

    pub fn names(&self) -> Vec<&N> {
        match self {
            Self::Constant(_) => Vec::new(),
            Self::Name(name) => vec![name],
            Self::Negative(number) | Self::Root(number) => number.names(),
            Self::Combined(combined) => [combined.0.names(), combined.2.names()].concat(),
        }
    }

    /// The names that are compared with a number, and these numbers.
    pub fn compared(&self) -> Vec<(&N, f64)> {
        let Self::Combined(combined) = self else {
            return Vec::new();
        };
        let (left, operator, right) = &**combined;
        match (left, right) {
            _ if operator.precedence < COMPARISON => [left.compared(), right.compared()].concat(),
            (Self::Name(name), number) | (number, Self::Name(name))
                if number.names().is_empty() =>
            {
                vec![(name, number.evaluate(&|_| f64::NAN))]
            }
            _ => Vec::new(),
        }
    }

    /// This expression, which starts at `position`, where a condition or a number is needed.
    fn demanded(self, condition: bool, position: usize) -> Result<Self, String> {
        let is_condition =
            matches!(&self, Self::Combined(combined) if combined.1.precedence <= COMPARISON);
        let problem = match (condition, is_condition) {
            (true, false) => "a comparison is needed here, such as frequency < 500",
            (false, true) => {
                "a number is needed here, this is a condition; join conditions by and, or"
            }
            _ => return Ok(self),
        };
        Err(at(position, problem))
    }
}

struct Reader<'a, N> {
    text: &'a str,
    /// Byte at which the next word or sign begins.
    next: usize,
    words: usize,
    names: Meanings<'a, N>,
}

impl<'a, N> Reader<'a, N> {
    /// Character of the text at which the next word or sign begins, counted from 1.
    fn position(&self) -> usize {
        self.text[..self.next].chars().count() + 1
    }

    /// What is wrong with the next word or sign, unless it means nothing anywhere.
    fn error(&self, problem: impl Into<String>) -> String {
        let has_meaning = |letter: char| is_of_name(letter) || "<>=!+-*/()".contains(letter);
        let problem = match self.peek() {
            other if other.chars().all(has_meaning) => problem.into(),
            other => format!(
                "\"{other}\" has no meaning here; allowed are keys, numbers, + - * / ( ) sqrt, < <= > >= == !=, and, or"
            ),
        };
        at(self.position(), &problem)
    }

    /// The next word, number or sign; empty at the end.
    fn peek(&self) -> &'a str {
        let rest = &self.text[self.next..];
        let is_number = rest.starts_with(|first: char| first.is_ascii_digit() || first == '.');
        let mut before = ' ';
        let ends = |letter: char| {
            let is_of_exponent = is_number && "+-".contains(letter) && "eE".contains(before);
            before = letter;
            !(is_of_name(letter) || is_of_exponent)
        };
        let mut letters = rest.chars();
        let length = match (
            rest.find(ends).unwrap_or(rest.len()),
            letters.next(),
            letters.next(),
        ) {
            (0, Some('<' | '>' | '=' | '!'), Some('=')) => 2,
            (0, Some(sign), _) => sign.len_utf8(),
            (length, ..) => length,
        };
        &rest[..length]
    }

    fn advance(&mut self) {
        let rest = &self.text[self.next + self.peek().len()..];
        self.next = self.text.len() - rest.trim_start().len();
        self.words += 1;
    }

    fn accept(&mut self, text: &str) -> bool {
        let found = self.peek() == text;
        if found {
            self.advance();
        }
        found
    }

    fn operator(&self) -> Option<Operator> {
        let word = self.peek();
        OPERATORS.into_iter().find(|operator| operator.sign == word)
    }

    /// Reads an expression whose operators have at least this precedence.
    fn expression(&mut self, min: u8) -> Result<Expression<N>, String> {
        let start = self.position();
        let mut left = self.factor()?;
        let binds = |operator: &Operator| operator.precedence >= min;
        while let Some(operator) = self.operator().filter(binds) {
            let joins_conditions = operator.precedence < COMPARISON;
            let demanded = left.demanded(joins_conditions, start)?;
            self.advance();
            let position = self.position();
            let right = self
                .expression(operator.precedence + 1)?
                .demanded(joins_conditions, position)?;
            left = Expression::Combined(Box::new((demanded, operator, right)));
            let next = self.operator().map(|next| next.precedence);
            if operator.precedence == COMPARISON && next == Some(COMPARISON) {
                return Err(
                    self.error("a second comparison; write a < b and b < c instead of a < b < c")
                );
            }
        }
        if matches!(self.peek(), "=" | "!") {
            return Err(self.error(format!("write {0}= instead of {0}", self.peek())));
        }
        Ok(left)
    }

    fn factor(&mut self) -> Result<Expression<N>, String> {
        if self.words >= MAX_WORDS {
            return Err(self.error(format!(
                "more than {MAX_WORDS} words and signs; split it into a list of conditions"
            )));
        }
        if self.accept("-") {
            let start = self.position();
            let number = self.factor()?.demanded(false, start)?;
            return Ok(Expression::Negative(Box::new(number)));
        }
        if self.peek() == "(" {
            return self.parenthesis();
        }
        if self.accept("sqrt") {
            let start = self.position();
            let number = self.parenthesis()?.demanded(false, start)?;
            return Ok(Expression::Root(Box::new(number)));
        }
        let text = self.peek();
        let expression = match text.chars().next() {
            None => {
                return Err(self.error("the condition ends too early; a key or a number is needed"));
            }
            Some('0'..='9' | '.') => match text.parse() {
                Ok(constant) if f64::is_finite(constant) => Expression::Constant(constant),
                _ => return Err(self.error(format!("\"{text}\" is not a number"))),
            },
            Some(first) if is_of_name(first) => {
                Expression::Name((self.names)(text).map_err(|problem| self.error(problem))?)
            }
            Some(_) => {
                return Err(self.error(format!(
                    "\"{text}\" is not expected here; a key or a number is needed"
                )));
            }
        };
        self.advance();
        Ok(expression)
    }

    fn parenthesis(&mut self) -> Result<Expression<N>, String> {
        if !self.accept("(") {
            return Err(self.error("an opening ( is missing"));
        }
        let inside = self.expression(OR)?;
        if self.accept(")") {
            Ok(inside)
        } else {
            Err(self.error("a closing ) is missing"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::quantity::{GridPoint, Quantity};
    use super::*;
    use crate::model::Parameters;

    type Condition = Expression<Quantity>;

    fn parse(text: &str) -> Result<Condition, String> {
        Condition::condition(text, &Quantity::comparable)
    }

    fn holds_at(text: &str, amplitude: f64, period: (Quantity, f64)) -> bool {
        let parameters = Parameters {
            modulation_amplitude: amplitude,
            ..Parameters::default()
        };
        let point = GridPoint {
            parameters,
            fixes_period: Some(period),
        }
        .canonical();
        parse(text)
            .unwrap_or_else(|error| panic!("{text}: {error}"))
            .evaluate(&|&name| point.number(name))
            == 1.0
    }

    fn holds(text: &str) -> bool {
        holds_at(text, 1e-6, (Quantity::Frequency, 49.0))
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
            ("sqrt(Kd * 4e7) == Kd and -sqrt( 9 )*2 == -6", true),
            ("sqrt(-1) < 1 or sqrt(-1) >= 1", false),
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
    fn numbers_are_equal_if_twelve_digits_are() {
        assert!(holds("Delta == 1.000000000004e-6 and 0 == 0"));
        assert!(holds("Delta != 1.00000000001e-6 and 1e-320 != 0"));
        assert!(!holds("Delta != 1.000000000004e-6"));
    }

    #[test]
    fn without_modulation_eta_and_the_frequency_are_zero() {
        for text in ["eta == 0", "frequency == 0", "T > 1e300"] {
            assert!(holds_at(text, 0.0, (Quantity::Eta, 3.0)), "{text}");
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
            ("sqrt T < 1", 6, "opening ("),
            ("sqrt(T < 1) > 1", 5, "a number is needed"),
            ("T < 1)", 6, "not expected"),
            ("T < 1 T > 0", 7, "and, or"),
            ("T <", 4, "too early"),
            ("", 1, "too early"),
            ("T & 1", 3, "no meaning"),
            ("break_on == 1", 1, "cannot be compared"),
            ("(T < 1) + 1 > 2", 1, "a number is needed"),
            ("T < 1 and 3", 11, "comparison is needed"),
            ("T < 1e999", 5, "not a number"),
            ("\u{a7} < 1", 1, "no meaning"),
            ("\u{3c4} < 1", 1, "not a known quantity"),
        ] {
            let error = parse(text).expect_err(text);
            let place = format!("at character {position}: ");
            assert!(
                error.starts_with(&place) && error.contains(words),
                "{text}: {error}"
            );
        }
        let deep = "(".repeat(100_000);
        assert!(parse(&deep).unwrap_err().contains("more than 500"));
    }
}
