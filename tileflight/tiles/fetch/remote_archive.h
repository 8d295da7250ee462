#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/http_options.h"
#include "tileflight/tiles/fetch/http_provider.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/fetch/zip_archive.h"

namespace tileflight::fetch {

/// A .3tz on a server, of which only the directory and the entries that are used are fetched (HTTP range requests, RFC
/// 9110, section 14). A file that changes meanwhile is noticed by its ETag. Nothing is cached on disk. Thread safe.
class RemoteArchiveSource : public TileSource {
 public:
  /// Reads the directory. Throws InputError: the server does not answer or knows no ranges, not an archive, no
  /// tileset.json.
  explicit RemoteArchiveSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options = {},
                               const ZipLimits& limits = {});
  ~RemoteArchiveSource() override;

  std::string root_uri() const override { return "tileset.json"; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& uri) override;
  std::vector<std::string> attribution() const override { return provider_->attribution(); }
  TermsOfUse terms() const override { return provider_->terms(); }
  std::vector<std::string> warnings() const override { return archive_->warnings(); }

 private:
  class RangeReader;

  std::unique_ptr<HttpProvider> provider_;
  std::string name_;
  std::shared_ptr<RangeReader> file_;
  std::unique_ptr<ZipArchive> archive_;
};

}  // namespace tileflight::fetch
