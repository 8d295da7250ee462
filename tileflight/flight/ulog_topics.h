#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace tileflight::flight {

/// What to read of a ULog topic: names of its own fields, elements of arrays as "q[0]".
using UlogFields = std::vector<std::string>;

/// Topics by name, each a row of numbers for each of its messages in the file's order; rows have the order of the
/// fields that were asked for, NaN for those that the file's format of the topic has not.
struct UlogTopics {
  std::map<std::string, std::vector<std::vector<double>>> rows;
  std::vector<std::string> warnings;
};

/// Reads the first instance of each wanted topic from a ULog file's bytes (docs.px4.io, "ULog File Format", version 1;
/// appended data too). Broken stretches are skipped up to the next synchronisation message, a cut file is read as far
/// as it goes, and what the logger itself dropped is added up; `warnings` tells of each. Throws InputError (`where`,
/// cause) when the bytes are no ULog file or need features that are not known.
UlogTopics read_ulog_topics(std::span<const std::byte> bytes, const std::map<std::string, UlogFields>& wanted,
                            const std::string& where);

}  // namespace tileflight::flight
