#pragma once

#include <filesystem>
#include <string>

#include "tileflight/experiments/report/key_figures.h"

namespace tileflight::report {

/// The table of key figures as CSV (RFC 4180, UTF-8): one column per flight, named by source and flight; numbers as on
/// the page; empty fields for unknown values.
std::string key_figures_csv(const KeyFigures& figures);

/// The table as a LaTeX tabular with booktabs rules, to be \input into a table environment.
std::string key_figures_latex(const KeyFigures& figures);

/// Escapes plain text (UTF-8) for LaTeX: special characters are escaped, the page's typographic ones become commands.
std::string latex_text(const std::string& plain);

/// Writes `key-figures.csv` and `key-figures.tex` into the folder, creating it if necessary. Throws InputError.
void write_key_figures(const std::filesystem::path& folder, const KeyFigures& figures);

}  // namespace tileflight::report
