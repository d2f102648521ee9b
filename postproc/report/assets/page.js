// The script of pages with nothing but text, pictures and tables.
import { dress } from "./dress.js";

dress();
