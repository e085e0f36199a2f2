// Axes: where values lie, and their ticks.

class Axis {
  constructor({ label, log = false, low, high, whole = false, few = [] }) {
    Object.assign(this, { label, log, low, high, whole, few });
    this.start = log ? Math.log(low) : low;
    this.span = (log ? Math.log(high) : high) - this.start;
  }

  /** Where a value lies, from 0 to 1. */
  place(value) {
    return ((this.log ? Math.log(value) : value) - this.start) / this.span;
  }

  value(place) {
    return this.log ? this.low * (this.high / this.low) ** place : this.low + place * (this.high - this.low);
  }

  /** Values with their labels; without for those between. */
  ticks(room) {
    const few = this.few.filter((value) => value >= this.low && value <= this.high);
    if (few.length > 1 && few.length <= room) return few.map((value) => [value, number(value)]);
    return this.log && this.high / this.low > 3 ? this.logTicks(room) : this.linearTicks(room);
  }

  linearTicks(room) {
    const rough = (this.high - this.low) / Math.max(2, room);
    const power = 10 ** Math.floor(Math.log10(rough));
    let step = power * ([1, 2, 5].find((factor) => factor * power >= rough) ?? 10);
    if (this.whole) step = Math.max(1, Math.round(step));
    const ticks = [];
    for (let k = Math.ceil(this.low / step); k * step <= this.high && ticks.length < 40; k++) {
      ticks.push(k * step);
    }
    const digits = distinguishing(ticks, 6);
    return ticks.map((tick) => [tick, number(tick, digits)]);
  }

  logTicks(room) {
    const [first, last] = [Math.floor(Math.log10(this.low)), Math.ceil(Math.log10(this.high))];
    const decades = Math.log10(this.high / this.low);
    const every = Math.max(1, Math.ceil(decades / room));
    const ticks = [];
    for (let decade = first; decade <= last; decade++) {
      for (let digit = 1; digit < 10; digit++) {
        const value = Number(`${digit}e${decade}`);
        if (value < this.low || value > this.high) continue;
        const isLabelled = digit === 1 ? decade % every === 0 : decades < 2 && (digit === 2 || digit === 5);
        ticks.push([value, isLabelled ? power(digit, decade) : ""]);
      }
    }
    return ticks;
  }
}

/** Values that most points share, if they are few. */
function fewOf(values) {
  const known = values.filter((value) => value !== null && Number.isFinite(value));
  const few = [...new Set(known.map((value) => Number(value.toPrecision(10))))];
  return few.length <= 8 && few.length < known.length ? few : [];
}

const RAISED = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

/** A digit times a power of ten. */
function power(digit, exponent) {
  if (exponent >= -3 && exponent <= 3) return number(Number(`${digit}e${exponent}`));
  return `${digit === 1 ? "" : `${digit}·`}10${[...String(exponent)].map((c) => RAISED[c]).join("")}`;
}
