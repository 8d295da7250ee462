#include "tileflight/live/simulator/client_file_access.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"

namespace tileflight::simulator {
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxLength = 1000;

bool lies_below(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end() && path != root;
}

}  // namespace

ClientFileAccess::ClientFileAccess(std::optional<fs::path> root) {
  if (!root) return;
  std::error_code error;
  fs::create_directories(*root, error);
  root_ = fs::canonical(*root, error);
  if (error) throw InputError(root->string(), "cannot be used as the folder for clients' files");
}

fs::path ClientFileAccess::resolve_writable(const std::string& name) const {
  if (!root_) throw InputError("file", "this server does not write files for clients; start it with --files FOLDER");
  if (name.empty() || name.size() > kMaxLength || name.find('\0') != std::string::npos)
    throw InputError("file", "the name is empty or too long");
  const fs::path path = fs::weakly_canonical(*root_ / name);
  if (!lies_below(path, *root_) || !path.has_filename())
    throw InputError("file",
                     "'" + name.substr(0, 200) + "' lies outside the folder that clients may write to (--files)");
  fs::create_directories(path.parent_path());
  return path;
}

}  // namespace tileflight::simulator
