// The cells of a spin map: a column per tag or run of tags, a row per spin, the first at the bottom.

// column and spin under a pixel of the picture; null outside of the map
export function tagAndSpin({ box, names, spins }, x, y) {
  const [left, top, width, height] = box;
  const column = Math.floor(((x - left) / width) * names.length);
  const spin = spins.length - 1 - Math.floor(((y - top) / height) * spins.length);
  const inside = column >= 0 && column < names.length && spin >= 0 && spin < spins.length;
  return inside ? [column, spin] : null;
}

export function wordsOf(map, column, spin) {
  const cell = column * map.spins.length + spin;
  const [first, last] = map.names[column];
  const name = first === last ? `tag ${first}` : `tags ${first} to ${last}`;
  const stiffness = map.stiffness[cell];
  const chosen = map.chosen[column];
  return (
    `${name} (CAM line ${map.lines[column]}), ${map.spins[spin]} deg: ` +
    map.words[map.classes[cell]] +
    (Number.isFinite(stiffness) ? `, ${stiffness.toFixed(0)} N/mm` : "") +
    (Number.isFinite(chosen) ? `; chosen ${chosen.toFixed(1)} deg` : "")
  );
}
