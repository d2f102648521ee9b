// What every page does with its tables and charts.
import { drawCharts } from "./chart.js";
import { sortTables } from "./tables.js";

export function dress() {
  sortTables();
  drawCharts();
}
