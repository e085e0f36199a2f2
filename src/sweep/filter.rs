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
//! 0 and `T` is infinite. A comparison with something undefined, such as 0/0, does not hold.

use super::quantity::{Point, Quantity};
use super::source::nearest;
use crate::model::Symbol;

/// Most words and signs of a condition: it is read and evaluated by recursion.
const MAX_TOKENS: usize = 500;

/// A condition on a point.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Condition {
    Compare(Number, Comparison, Number),
    All(Vec<Self>),
    Any(Vec<Self>),
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Number {
    Constant(f64),
    Quantity(Quantity),
    Negative(Box<Self>),
    Combined(Box<(Self, Operator, Self)>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Comparison {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    NotEqual,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
}

/// What is wrong with a condition, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("at character {position}: {problem}")]
pub(super) struct ConditionError {
    /// Character of the condition, counted from 1.
    pub position: usize,
    pub problem: String,
}

impl Condition {
    /// Reads a condition.
    pub fn parse(text: &str) -> Result<Self, ConditionError> {
        let tokens = tokens(text)?;
        let mut reader = Reader { tokens: &tokens, next: 0, end: text.chars().count() + 1 };
        let start = reader.position();
        let term = reader.condition()?;
        if reader.next < tokens.len() {
            let found = &tokens[reader.next].text;
            return Err(reader.error(format!("\"{found}\" is not expected here; join conditions by and, or")));
        }
        term.condition(start)
    }

    /// Whether a canonical point fulfils it.
    pub fn holds(&self, point: &Point) -> bool {
        match self {
            Self::All(conditions) => conditions.iter().all(|condition| condition.holds(point)),
            Self::Any(conditions) => conditions.iter().any(|condition| condition.holds(point)),
            Self::Compare(left, comparison, right) => {
                left.evaluate(point).partial_cmp(&right.evaluate(point)).is_some_and(|order| match comparison {
                    Comparison::Less => order.is_lt(),
                    Comparison::LessOrEqual => order.is_le(),
                    Comparison::Greater => order.is_gt(),
                    Comparison::GreaterOrEqual => order.is_ge(),
                    Comparison::Equal => order.is_eq(),
                    Comparison::NotEqual => order.is_ne(),
                })
            }
        }
    }
}

impl Number {
    fn evaluate(&self, point: &Point) -> f64 {
        match self {
            Self::Constant(constant) => *constant,
            Self::Quantity(quantity) => point.number(*quantity),
            Self::Negative(number) => -number.evaluate(point),
            Self::Combined(combined) => {
                let (left, operator, right) = &**combined;
                let (left, right) = (left.evaluate(point), right.evaluate(point));
                match operator {
                    Operator::Plus => left + right,
                    Operator::Minus => left - right,
                    Operator::Times => left * right,
                    Operator::Over => left / right,
                }
            }
        }
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
        let while_in = |from: usize, allowed: &dyn Fn(char) -> bool| {
            from + characters[from..].iter().take_while(|character| allowed(**character)).count()
        };
        next = match character {
            character if character.is_whitespace() => {
                next += 1;
                continue;
            }
            'a'..='z' | 'A'..='Z' | '_' => while_in(start, &|c| c.is_ascii_alphanumeric() || c == '_'),
            '0'..='9' | '.' => {
                let mantissa = while_in(start, &|c| c.is_ascii_digit() || c == '.');
                if matches!(characters.get(mantissa), Some('e' | 'E')) {
                    let signed = usize::from(matches!(characters.get(mantissa + 1), Some('+' | '-')));
                    while_in(mantissa + 1 + signed, &|c| c.is_ascii_alphanumeric())
                } else {
                    while_in(mantissa, &|c| c.is_ascii_alphanumeric() || c == '_')
                }
            }
            '<' | '>' | '=' | '!' => start + 1 + usize::from(characters.get(start + 1) == Some(&'=')),
            '+' | '-' | '*' | '/' | '(' | ')' => start + 1,
            other => {
                let problem = format!(
                    "\"{other}\" has no meaning here; allowed are keys, numbers, + - * / ( ), < <= > >= == !=, and, or"
                );
                return Err(ConditionError { position: start + 1, problem });
            }
        };
        tokens.push(Token { position: start + 1, text: characters[start..next].iter().collect() });
        if tokens.len() > MAX_TOKENS {
            let problem = format!("more than {MAX_TOKENS} words and signs; split it into a list of conditions");
            return Err(ConditionError { position: start + 1, problem });
        }
    }
    Ok(tokens)
}

/// A part of a condition, of either kind: which one an opening parenthesis holds shows only later.
enum Term {
    Number(Number),
    Condition(Condition),
}

impl Term {
    fn number(self, position: usize) -> Result<Number, ConditionError> {
        match self {
            Self::Number(number) => Ok(number),
            Self::Condition(_) => Err(ConditionError {
                position,
                problem: "a number is needed here, this is a condition; join conditions by and, or".to_owned(),
            }),
        }
    }

    fn condition(self, position: usize) -> Result<Condition, ConditionError> {
        match self {
            Self::Condition(condition) => Ok(condition),
            Self::Number(_) => Err(ConditionError {
                position,
                problem: "a comparison is needed here, such as frequency < 500".to_owned(),
            }),
        }
    }
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

    fn error(&self, problem: String) -> ConditionError {
        ConditionError { position: self.position(), problem }
    }

    fn peek(&self) -> &str {
        self.tokens.get(self.next).map_or("", |token| token.text.as_str())
    }

    fn accept(&mut self, text: &str) -> bool {
        let found = self.peek() == text;
        self.next += usize::from(found);
        found
    }

    fn condition(&mut self) -> Result<Term, ConditionError> {
        self.joined("or", Self::both, Condition::Any)
    }

    fn both(&mut self) -> Result<Term, ConditionError> {
        self.joined("and", Self::comparison, Condition::All)
    }

    fn joined(
        &mut self,
        word: &str,
        part: fn(&mut Self) -> Result<Term, ConditionError>,
        join: fn(Vec<Condition>) -> Condition,
    ) -> Result<Term, ConditionError> {
        let start = self.position();
        let first = part(self)?;
        if self.peek() != word {
            return Ok(first);
        }
        let mut conditions = vec![first.condition(start)?];
        while self.accept(word) {
            let start = self.position();
            conditions.push(part(self)?.condition(start)?);
        }
        Ok(Term::Condition(join(conditions)))
    }

    fn comparison(&mut self) -> Result<Term, ConditionError> {
        let start = self.position();
        let left = self.sum()?;
        let Some(comparison) = comparison_sign(self.peek()) else {
            if matches!(self.peek(), "=" | "!") {
                return Err(self.error(format!("write {0}= instead of {0}", self.peek())));
            }
            return Ok(left);
        };
        let left = left.number(start)?;
        self.next += 1;
        let start = self.position();
        let right = self.sum()?.number(start)?;
        if comparison_sign(self.peek()).is_some() {
            return Err(self.error("a second comparison; write a < b and b < c instead of a < b < c".to_owned()));
        }
        Ok(Term::Condition(Condition::Compare(left, comparison, right)))
    }

    fn sum(&mut self) -> Result<Term, ConditionError> {
        self.combined(&[("+", Operator::Plus), ("-", Operator::Minus)], Self::product)
    }

    fn product(&mut self) -> Result<Term, ConditionError> {
        self.combined(&[("*", Operator::Times), ("/", Operator::Over)], Self::factor)
    }

    fn combined(
        &mut self,
        operators: &[(&str, Operator)],
        part: fn(&mut Self) -> Result<Term, ConditionError>,
    ) -> Result<Term, ConditionError> {
        let start = self.position();
        let mut left = part(self)?;
        while let Some(&(_, operator)) = operators.iter().find(|(sign, _)| *sign == self.peek()) {
            self.next += 1;
            let from = self.position();
            let right = part(self)?.number(from)?;
            left = Term::Number(Number::Combined(Box::new((left.number(start)?, operator, right))));
        }
        Ok(left)
    }

    fn factor(&mut self) -> Result<Term, ConditionError> {
        if self.accept("-") {
            let start = self.position();
            return Ok(Term::Number(Number::Negative(Box::new(self.factor()?.number(start)?))));
        }
        if self.accept("(") {
            let inside = self.condition()?;
            if !self.accept(")") {
                return Err(self.error("a closing ) is missing".to_owned()));
            }
            return Ok(inside);
        }
        let number = self.number()?;
        self.next += 1;
        Ok(Term::Number(number))
    }

    fn number(&self) -> Result<Number, ConditionError> {
        let text = self.peek();
        match text.chars().next() {
            None => Err(self.error("the condition ends too early; a key or a number is needed".to_owned())),
            Some(first) if first.is_ascii_digit() || first == '.' => match text.parse() {
                Ok(constant) if f64::is_finite(constant) => Ok(Number::Constant(constant)),
                _ => Err(self.error(format!("\"{text}\" is not a number"))),
            },
            Some(first) if first.is_ascii_alphabetic() || first == '_' => match Quantity::from_key(text) {
                Some(Quantity::Parameter(Symbol::BreakOn)) => {
                    Err(self
                        .error("break_on is a word and cannot be compared; choose its values on an axis".to_owned()))
                }
                Some(quantity) => Ok(Number::Quantity(quantity)),
                None => {
                    let keys: Vec<_> = Quantity::all().map(Quantity::key).filter(|key| *key != "break_on").collect();
                    Err(self.error(format!("\"{text}\" is not a known quantity; {}", nearest(text, &keys))))
                }
            },
            Some(_) => Err(self.error(format!("\"{text}\" is not expected here; a key or a number is needed"))),
        }
    }
}

fn comparison_sign(text: &str) -> Option<Comparison> {
    Some(match text {
        "<" => Comparison::Less,
        "<=" => Comparison::LessOrEqual,
        ">" => Comparison::Greater,
        ">=" => Comparison::GreaterOrEqual,
        "==" => Comparison::Equal,
        "!=" => Comparison::NotEqual,
        _ => return None,
    })
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
