// The legend under the 3D view: a bar of colours between the lowest and the highest value.
import { byId } from "./dom.js";
import { spell } from "./numbers.js";

export function showLegend({ low, high, gradient }) {
  byId("legend").style.background = gradient;
  byId("low").textContent = low <= high ? spell(low) : "";
  byId("high").textContent = low <= high ? spell(high) : "";
}

// calls an action with the chosen column, now and whenever another one is chosen
export function onColourChoice(columns, action) {
  const choice = byId("colour");
  const choose = () => {
    const column = columns.find(({ key }) => key === choice.value);
    if (column) action(column);
  };
  choice.addEventListener("change", choose);
  choose();
}
