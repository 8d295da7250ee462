#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace tileflight::base {

/// Names the kind of a file that a reader does not take, for its message; recognize_file() finds it by the content.
struct FileKind {
  std::string name;    ///< with its article: "a ROS 1 bag"
  std::string remedy;  ///< what to do to get what it holds, as a command where there is one: "extract …"
  bool is_video = false;
};

/// Number of bytes that recognize_file() looks at.
inline constexpr std::size_t kHeadBytes = 4096;

/// Reads the first kHeadBytes of a file; fewer if it is shorter, none if it cannot be read.
std::string read_head(const std::filesystem::path& file);

/// Recognizes a file by its first bytes: videos, photos, archives, bags, databases, tables of other programs, logs that
/// another program converts, web pages, and bytes that are no text. nullopt for text that may be anything.
std::optional<FileKind> recognize_file(std::string_view head);

/// Returns a sentence for a message: "is a ROS 1 bag, not a flight log: extract …". `wanted`: what the reader takes,
/// with its article. nullopt if the file is not recognized.
std::optional<std::string> refusal_of_kind(std::string_view head, const std::string& wanted);

}  // namespace tileflight::base
