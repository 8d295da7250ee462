#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"

namespace tileflight::experiment {

/// Fills an empty folder with hard links to the files of another (copies where the file system has none): writers
/// replace files, so neither folder changes the other. Throws InputError.
void link_files(const std::filesystem::path& from, const std::filesystem::path& to);

/// A kind of folder that several runs share.
struct SharedKind {
  std::string command;  ///< that writes it (base::OutputFolder)
  std::string name;     ///< "truth"
  /// Changes what a run's copy of an entry tells of its inputs, which may lie elsewhere; empty: nothing.
  std::function<void(const std::filesystem::path& folder)> adapt{};
};

/// Returns the kind of ground truths. `source`: of the runs, as extract.json names it.
SharedKind shared_truths(const std::string& source);
/// Returns the kind of built-in places.
SharedKind shared_places();

/// Ground truths or built-in places that several runs share, each made once: FOLDER/KEY, where KEY is a hash of all
/// that it comes from, with FOLDER/KEY.json, which lists its files and is written last. A run's folder is hard links to
/// the files of an entry (copies on another file system), so an entry, or the whole cache, can be removed at any time
/// without harm to a run; nothing removes a whole entry by itself. Processes wait for the one that makes an entry; an
/// entry that a killed process left, or whose files were changed since, is made again.
class FolderCache {
 public:
  /// Writes an entry into a folder that may exist.
  using Write = std::function<void(const std::filesystem::path& folder)>;

  /// `folder`: empty: nothing is shared. `refresh`: entries are made again once.
  FolderCache(std::filesystem::path folder, SharedKind kind, bool refresh, const Progress& progress);

  /// Links the files of an entry into `to`, if there is one; returns whether there was. Throws InputError.
  bool take(const std::string& key, const std::filesystem::path& to) const;

  /// Makes the entry, and links its files into `to`. Throws InputError.
  void make(const std::string& key, const std::filesystem::path& to, const Write& write) const;

 private:
  bool link(const std::string& key, const std::filesystem::path& to) const;

  std::filesystem::path folder_;
  SharedKind kind_;
  bool refresh_;
  const Progress& progress_;
};

}  // namespace tileflight::experiment
