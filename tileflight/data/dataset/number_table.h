#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::dataset {

/// A CSV file of numbers with a header, for the other sensors' readings. Infinities are written as inf and -inf.
struct NumberTable {
  std::vector<std::string> columns;       ///< names with units: "pressure [Pa]"
  std::vector<std::vector<double>> rows;  ///< one number per column
};

/// Numbers round-trip exactly. Reading throws InputError (file, line, cause): no header, a row of another length, a
/// cell that is not a number.
NumberTable read_number_table(const std::filesystem::path& file);
void write_number_table(const std::filesystem::path& file, const NumberTable& table);

}  // namespace tileflight::dataset
