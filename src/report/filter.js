// The filter of sets: a condition on their columns, in the language of the option `--where` (src/sweep/expression.rs).

/** Half of the twelfth digit. */
const isEqual = (a, b) => a === b || Math.abs(a - b) <= 5e-12 * Math.max(Math.abs(a), Math.abs(b));
const [AND, COMPARISON] = [2, 3];
/** Of each sign its precedence and its value. Undefined numbers, NaN, fulfil no comparison. */
const OPERATORS = new Map([
  ["or", [1, (a, b) => a || b]],
  ["and", [AND, (a, b) => a && b]],
  ["<", [COMPARISON, (a, b) => a < b]],
  ["<=", [COMPARISON, (a, b) => a <= b]],
  [">", [COMPARISON, (a, b) => a > b]],
  [">=", [COMPARISON, (a, b) => a >= b]],
  ["==", [COMPARISON, isEqual]],
  ["!=", [COMPARISON, (a, b) => (a < b || a > b) && !isEqual(a, b)]],
  ["+", [4, (a, b) => a + b]],
  ["-", [4, (a, b) => a - b]],
  ["*", [5, (a, b) => a * b]],
  ["/", [5, (a, b) => a / b]],
]);
const LETTER = "[\\p{Alphabetic}\\p{N}_.⟨⟩]";
const WORD = new RegExp(`\\s*((?:[\\d.](?:(?<=[eE])[+-]|${LETTER})*|${LETTER}+|[<>=!]=|.)|$)`, "gsuy");
const HAS_MEANING = new RegExp(`^(${LETTER}|[<>=!+*/()-])*$`, "u");
const NUMBER = /^(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$/;

/** A condition as a function of the place of a set. An error says what is wrong with it, and at which character. */
function condition(report, text) {
  const words = [...text.matchAll(WORD)];
  let next = 0;
  const peek = () => words[next][1];
  const position = () => [...text.slice(0, words[next].index + words[next][0].length - peek().length)].length + 1;
  const refuse = (problem, at) => {
    const allowed = "allowed are keys, numbers, + - * / ( ) sqrt, < <= > >= == !=, and, or";
    const found = at || HAS_MEANING.test(peek()) ? problem : `"${peek()}" has no meaning here; ${allowed}`;
    throw new Error(`at character ${at ?? position()}: ${found}`);
  };
  const demand = (isCondition, at, part) => {
    if (Boolean(part.isCondition) === isCondition) return part.value;
    const number = "a number is needed here, this is a condition; join conditions by and, or";
    return refuse(isCondition ? "a comparison is needed here, such as frequency < 500" : number, at);
  };
  const column = (name) => {
    const found = report.columns.get(name) ?? [...report.columns.values()].find(({ symbol }) => symbol === name);
    if (!found) refuse(unknown(report, name));
    const instead = "a number is needed here, such as slip_share, which is 0.95 or more where sets slide";
    return isNumeric(found) ? (set) => found.values[set] ?? NaN : refuse(`${name} holds words; ${instead}`);
  };
  const number = (word) => {
    const value = NUMBER.test(word) ? Number(word) : NaN;
    return Number.isFinite(value) ? () => value : refuse(`"${word}" is not a number`);
  };
  const factor = () => {
    if (next >= 500) refuse("more than 500 words and signs; split it into a list of conditions");
    const word = peek();
    if (word === "sqrt") {
      next++;
      const at = position();
      if (peek() !== "(") refuse("an opening ( is missing");
      const square = demand(false, at, factor());
      return { value: (set) => Math.sqrt(square(set)) };
    }
    if (!word) refuse("the condition ends too early; a key or a number is needed");
    const isValue = HAS_MEANING.test(word) && !/^[<>=!+*/()-]/.test(word);
    const value = isValue && (/^[\d.]/.test(word) ? number : column)(word);
    if (!isValue && word !== "-" && word !== "(") refuse(`"${word}" is not expected here; a key or a number is needed`);
    next++;
    if (isValue) return { value };
    const inside = word === "(" ? expression(1) : demand(false, position(), factor());
    if (word === "-") return { value: (set) => -inside(set) };
    if (peek() !== ")") refuse("a closing ) is missing");
    next++;
    return inside;
  };
  /** Reads an expression whose operators have at least this precedence. */
  const expression = (least) => {
    const start = position();
    let left = factor();
    const precedence = () => OPERATORS.get(peek())?.[0] ?? 0;
    while (precedence() >= least) {
      const [own, combine] = OPERATORS.get(peek());
      const a = demand(own <= AND, start, left);
      next++;
      const b = demand(own <= AND, position(), expression(own + 1));
      left = { value: (set) => combine(a(set), b(set)), isCondition: own <= COMPARISON };
      const isSecond = own === COMPARISON && precedence() === COMPARISON;
      if (isSecond) refuse("a second comparison; write a < b and b < c instead of a < b < c");
    }
    return peek() === "=" || peek() === "!" ? refuse(`write ${peek()}= instead of ${peek()}`) : left;
  };
  const start = position();
  const whole = expression(1);
  if (peek()) refuse(`"${peek()}" is not expected here; join conditions by and, or`);
  return demand(true, start, whole);
}

/** That there is no such column, and those that were probably meant. */
function unknown({ columns, synonyms }, name) {
  const names = [...columns.keys()];
  const synonym = synonyms.find(([word]) => word === name.replaceAll("_", " "))?.[1];
  const longer = names.filter((known) => (known.startsWith(name) || known.endsWith(`_${name}`)) && columns.get(known).end_of === null).slice(0, 8);
  const near = (most) => names.find((known) => isNear(name.toLowerCase(), known.toLowerCase(), most));
  const nearest = [0, 1, 2].slice(0, 1 + name.length / 2).map(near).find(Boolean);
  const meant = synonym ?? (longer.join(", ") || nearest);
  return `no such column;${meant ? ` did you mean ${meant}?` : ""} The list of columns above the table has all`;
}

/** Whether one word becomes another if at most so many letters are put in, left out or replaced. */
function isNear(one, other, most) {
  if (one === other || most === 0) return one === other;
  let k = 0;
  while (one[k] === other[k]) k++;
  const [a, b] = [one.slice(k), other.slice(k)];
  return [[a.slice(1), b], [a, b.slice(1)], [a.slice(1), b.slice(1)]].some((pair) => isNear(...pair, most - 1));
}

/** Which sets of the chosen kind fulfil the filter, all if there is a problem with it; and that problem. */
function filtered(report) {
  let [holds, problem] = [() => true, ""];
  try {
    if (state.filter.trim()) holds = condition(report, state.filter);
  } catch (error) {
    problem = error.message;
  }
  const [regime, hasPhase] = ["regime", "has_phase"].map((name) => report.values(name));
  const kinds = (set) => ["", regime[set], hasPhase[set] ? "with a phase" : "without a phase"];
  const isShown = (set) => kinds(set).includes(state.kind) && holds(set);
  return { shown: Uint8Array.from({ length: report.setCount }, (_, set) => (isShown(set) ? 1 : 0)), problem };
}
