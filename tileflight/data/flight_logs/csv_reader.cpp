#include "tileflight/data/flight_logs/csv_reader.h"

#include <algorithm>

#include "tileflight/core/base/text_parsing.h"

namespace tileflight::flight_logs {

std::string CsvReader::quoted_cell() {
  std::string cell;
  rest_.remove_prefix(1);
  while (!rest_.empty()) {
    const char c = rest_.front();
    rest_.remove_prefix(1);
    if (c != '"') {
      cell += c;
    } else if (rest_.starts_with('"')) {
      cell += '"';
      rest_.remove_prefix(1);
    } else {
      break;
    }
  }
  plain_cell();  // skips text between the closing quote and the separator
  return cell;
}

std::string CsvReader::plain_cell() {
  const auto ends = [&](char c) { return c == separator_ || c == '\n'; };
  const auto end = std::find_if(rest_.begin(), rest_.end(), ends);
  const std::string_view cell = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
  rest_.remove_prefix(cell.size());
  return std::string(base::trim(cell));
}

void CsvReader::read_row(std::vector<std::string>& cells) {
  cells.clear();
  while (true) {
    while (rest_.starts_with(' ') && separator_ != ' ') rest_.remove_prefix(1);
    cells.push_back(rest_.starts_with('"') ? quoted_cell() : plain_cell());
    if (rest_.empty()) return;
    const bool ends_row = rest_.front() == '\n';
    rest_.remove_prefix(1);
    if (ends_row) return;
  }
}

bool CsvReader::next(std::vector<std::string>& cells) {
  while (!rest_.empty()) {
    read_row(cells);
    if (std::any_of(cells.begin(), cells.end(), [](const std::string& cell) { return !cell.empty(); })) return true;
  }
  return false;
}

char detect_separator(std::string_view header) {
  std::size_t commas = 0, semicolons = 0, tabs = 0;
  bool quoted = false;
  for (const char c : header) {
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    commas += c == ',';
    semicolons += c == ';';
    tabs += c == '\t';
  }
  if (tabs > commas && tabs > semicolons) return '\t';
  return semicolons > commas ? ';' : ',';
}

}  // namespace tileflight::flight_logs
