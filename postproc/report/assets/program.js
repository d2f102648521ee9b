// The page of a program, or of the run of one.
import { pageData } from "./data.js";
import { ProgramView } from "./program_view.js";
import { dress } from "./dress.js";

dress();
window.ppPage = new ProgramView(pageData());
