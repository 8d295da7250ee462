#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace tileflight::flight_logs {

/// Fields to read from a ULog topic, by name; array elements as "q[0]".
using UlogFields = std::vector<std::string>;

/// Topics by name: one row of numbers per message in file order, in the order of the requested fields, NaN for fields
/// that the file's format of the topic lacks.
struct UlogTopics {
  std::map<std::string, std::vector<std::vector<double>>> rows;
  std::vector<std::string> warnings;
};

/// Reads the first instance of each wanted topic from a ULog file (docs.px4.io, "ULog File Format", version 1; also
/// appended data). Corrupt sections are skipped up to the next synchronization message, a truncated file is read as far
/// as possible, and the logger's own dropouts are summed; all are reported in `warnings`. Throws InputError (`where`,
/// cause) if the bytes are not a ULog file or need unknown features.
UlogTopics read_ulog_topics(std::span<const std::byte> bytes, const std::map<std::string, UlogFields>& requested,
                            const std::string& where);

}  // namespace tileflight::flight_logs
