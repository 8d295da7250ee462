#include "tileflight/data/dataset/number_table.h"

#include <cassert>
#include <string_view>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::dataset {

namespace {

std::vector<double> parse_row(const std::string& where, const std::vector<std::string_view>& fields,
                              std::size_t columns) {
  if (fields.size() != columns)
    throw InputError(where, "has " + std::to_string(fields.size()) + " numbers, but the header has " +
                                std::to_string(columns) + " columns");
  std::vector<double> row;
  for (const std::string_view field : fields) {
    const auto value = base::parse_number<double>(field);
    if (!value) throw InputError(where, "\"" + std::string(field) + "\" is not a number");
    row.push_back(*value);
  }
  return row;
}

}  // namespace

NumberTable read_number_table(const std::filesystem::path& file) {
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  NumberTable table;
  for (int number = 1; const auto line = base::take_line(rest); ++number) {
    const std::vector<std::string_view> fields = base::split_fields(*line, ",");
    if (fields.empty()) continue;
    if (table.columns.empty())
      table.columns.assign(fields.begin(), fields.end());
    else
      table.rows.push_back(parse_row(file.string() + ": line " + std::to_string(number), fields, table.columns.size()));
  }
  if (table.columns.empty()) throw InputError(file.string(), "is empty; expected a header line of column names");
  return table;
}

void write_number_table(const std::filesystem::path& file, const NumberTable& table) {
  std::string text;
  for (const std::string& column : table.columns) text += (text.empty() ? "" : ",") + column;
  text += '\n';
  for (const std::vector<double>& row : table.rows) {
    assert(row.size() == table.columns.size());
    for (std::size_t i = 0; i < row.size(); ++i) text += (i == 0 ? "" : ",") + base::fixed_text(row[i]);
    text += '\n';
  }
  base::write_file(file, text);
}

}  // namespace tileflight::dataset
