// Numbers as text, and the order of values.

export const DEGREES = 180 / Math.PI;

// a value as a cell of a list shows it
export function spell(value) {
  if (value === null || value === undefined) return "";
  if (typeof value !== "number" || Number.isInteger(value)) return String(value);
  return String(Math.abs(value) < 1 ? +value.toFixed(4) : +value.toPrecision(4));
}

// the number that a text begins with, null where it begins with none
export function numberIn(text) {
  const value = parseFloat(text.replace(/[\s,]/g, "").replace("−", "-"));
  return /^[-+−.\d]/.test(text) && Number.isFinite(value) ? value : null;
}

// lowest and highest finite value; [Infinity, -Infinity] where there is none
export function extent(arrays) {
  let low = Infinity;
  let high = -Infinity;
  for (const values of arrays) {
    for (const value of values) {
      if (!Number.isFinite(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}

// indices of values in their order, nulls last either way, equal ones as they came
export function sortedIndices(values, ascending) {
  const sign = ascending ? 1 : -1;
  return Array.from(values, (_, i) => i).sort((a, b) => {
    const x = values[a];
    const y = values[b];
    if (x === y) return a - b;
    if (x === null) return 1;
    if (y === null) return -1;
    return (x < y ? -1 : 1) * sign;
  });
}
