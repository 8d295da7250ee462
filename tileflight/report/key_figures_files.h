#pragma once

#include <filesystem>
#include <string>

#include "tileflight/report/key_figures.h"

namespace tileflight::report {

/// The table of key figures as CSV (RFC 4180, UTF-8): a column a flight, named by source and flight, numbers as printed
/// on the page, a field empty where the value is not known.
std::string key_figures_csv(const KeyFigures& figures);

/// A field of CSV, in quotes where it must be.
std::string csv_field(const std::string& plain);

/// The same as a LaTeX tabular with the rules of the package booktabs, to be \input into a table environment.
std::string key_figures_latex(const KeyFigures& figures);

/// Plain text (UTF-8) for LaTeX: its special characters escaped, the page's typographic ones as commands.
std::string latex_text(const std::string& plain);

/// Writes `key-figures.csv` and `key-figures.tex` into the folder, which is made. Throws InputError.
void write_key_figures(const std::filesystem::path& folder, const KeyFigures& figures);

}  // namespace tileflight::report
