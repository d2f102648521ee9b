// Findings grouped by code: severities that can be switched off, a click selects the tag.
import { element } from "./dom.js";

const SEVERITIES = ["error", "warning", "note"];
const MOST = 200; // rows of a group that are drawn; the group says how many there are

// findings: [[text, hint, severity, tag or null, code]] as groups, errors first, then as they came
export function groupsOf(findings) {
  const groups = new Map();
  for (const finding of findings) {
    const key = `${finding[2]} ${finding[4]}`;
    if (!groups.has(key)) groups.set(key, { severity: finding[2], code: finding[4], rows: [] });
    groups.get(key).rows.push(finding);
  }
  const rank = ({ severity }) => SEVERITIES.indexOf(severity);
  return [...groups.values()].sort((a, b) => rank(a) - rank(b));
}

function rowOf([text, hint, severity, tag], select) {
  const row = element("div", { className: `finding ${severity}` }, text);
  if (hint) row.append(element("br"), element("span", { className: "soft" }, hint));
  if (tag !== null) {
    row.dataset.goto = tag;
    row.tabIndex = 0;
    row.addEventListener("click", () => select(tag));
    row.addEventListener("keydown", ({ key }) => key === "Enter" && select(tag));
  }
  return row;
}

function groupBox({ severity, code, rows }, select) {
  const shown = rows.slice(0, MOST).map((row) => rowOf(row, select));
  if (rows.length > MOST) shown.push(element("p", {}, `and ${rows.length - MOST} more`));
  if (rows.length === 1) {
    shown[0].dataset.severity = severity;
    return shown[0];
  }
  const summary = element("summary", { className: severity }, `${rows.length} of ${code}`);
  const box = element("details", { open: rows.length <= 5 }, summary, ...shown);
  box.dataset.severity = severity;
  return box;
}

// shows findings in an element; select(tag) is what a click does
export function showFindings(host, findings, select) {
  host.replaceChildren();
  if (!findings.length) {
    host.append(element("p", { className: "good" }, "none"));
    return;
  }
  const boxes = groupsOf(findings).map((group) => groupBox(group, select));
  const bar = element("div", { className: "bar" });
  for (const severity of SEVERITIES) {
    const count = findings.filter((finding) => finding[2] === severity).length;
    if (!count) continue;
    const check = element("input", { type: "checkbox", checked: true, name: severity });
    check.addEventListener("change", () => {
      for (const box of boxes) {
        if (box.dataset.severity === severity) box.hidden = !check.checked;
      }
    });
    bar.append(element("label", {}, check, ` ${count} ${severity}${count > 1 ? "s" : ""}`));
  }
  host.append(bar, ...boxes);
}
