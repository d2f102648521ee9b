// The page of a program, or of the run of one.
import { pageData } from "./data.js";
import { ProgramView } from "./program_view.js";
import { sortTables } from "./tables.js";

sortTables();
window.ppPage = new ProgramView(pageData());
