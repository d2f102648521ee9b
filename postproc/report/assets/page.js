// The script of pages with nothing but text, pictures and tables.
import { sortTables } from "./tables.js";

sortTables();
