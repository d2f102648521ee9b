// The data of a page: JSON in which long arrays and texts are packed.

const ARRAYS = {
  float32: Float32Array,
  int32: Int32Array,
  uint16: Uint16Array,
  uint8: Uint8Array,
};

export function pageData() {
  return JSON.parse(document.getElementById("data").textContent);
}

function bytesOf(base64) {
  const raw = atob(base64);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

// {"type", "data"} to a flat typed array
export function unpack(packed) {
  return new ARRAYS[packed.type](bytesOf(packed.data).buffer);
}

// {"type": "gzip", "data"} to a text
export async function unpackText(packed) {
  const stream = new Blob([bytesOf(packed.data)])
    .stream()
    .pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

// columns of the page's data with their values unpacked
export function unpackColumns(columns) {
  return columns.map((column) => ({ ...column, values: unpack(column.values) }));
}
