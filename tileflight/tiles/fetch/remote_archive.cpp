#include "tileflight/tiles/fetch/remote_archive.h"

#include <algorithm>
#include <charconv>
#include <list>
#include <mutex>
#include <optional>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/archive_source.h"
#include "tileflight/tiles/fetch/http_client.h"
#include "tileflight/tiles/fetch/origin_policy.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

/// Bytes that are fetched at once and kept: an entry's header and its data, or neighbouring small entries.
constexpr std::uint64_t kChunkBytes = std::uint64_t{256} << 10;
constexpr std::size_t kMostChunks = 64;

/// The length of the whole file in "bytes 0-0/1234"; nullopt: there is none.
std::optional<std::uint64_t> whole_length(const std::string& content_range) {
  const std::size_t slash = content_range.rfind('/');
  if (slash == std::string::npos) return std::nullopt;
  std::uint64_t length = 0;
  const char* const end = content_range.data() + content_range.size();
  const auto [last, fault] = std::from_chars(content_range.data() + slash + 1, end, length);
  return fault == std::errc() && last == end ? std::optional(length) : std::nullopt;
}

}  // namespace

/// The bytes of a file on a server.
class RemoteArchiveSource::RangeReader {
 public:
  RangeReader(HttpProvider& provider, const HttpSourceOptions& options)
      : provider_(provider),
        client_(options.http),
        url_(resolve_uri("", provider.resolve_root_url(client_))),
        policy_(url_, options.allowed_hosts) {
    const HttpResponse first = ask(0, 1);
    const std::optional<std::uint64_t> length = whole_length(first.header("content-range"));
    if (!length) throw InputError(name(), "the server does not say how long the file is: download it first");
    length_ = *length;
    if (const std::string tag = first.header("etag"); tag.starts_with('"')) tag_ = tag;
  }

  std::string name() const { return uri_for_message(url_); }
  std::uint64_t length() const { return length_; }

  std::vector<std::byte> read(std::uint64_t offset, std::size_t bytes) {
    if (bytes > kChunkBytes) return ask(offset, bytes).body;
    std::vector<std::byte> out;
    while (out.size() < bytes) {
      const std::uint64_t at = offset + out.size();
      const std::shared_ptr<const std::vector<std::byte>> chunk = chunk_at(at / kChunkBytes);
      const std::uint64_t begin = at % kChunkBytes;
      const std::uint64_t count = std::min<std::uint64_t>(bytes - out.size(), chunk->size() - begin);
      const auto first = chunk->begin() + static_cast<std::ptrdiff_t>(begin);
      out.insert(out.end(), first, first + static_cast<std::ptrdiff_t>(count));
    }
    return out;
  }

 private:
  using Chunk = std::shared_ptr<const std::vector<std::byte>>;

  /// The latest chunks are kept.
  Chunk chunk_at(std::uint64_t index) {
    {
      const std::lock_guard lock(mutex_);
      const auto kept = std::ranges::find(chunks_, index, &std::pair<std::uint64_t, Chunk>::first);
      if (kept != chunks_.end()) {
        chunks_.splice(chunks_.begin(), chunks_, kept);
        return kept->second;
      }
    }
    const std::uint64_t begin = index * kChunkBytes;
    auto chunk =
        std::make_shared<const std::vector<std::byte>>(ask(begin, std::min(kChunkBytes, length_ - begin)).body);
    const std::lock_guard lock(mutex_);
    chunks_.emplace_front(index, chunk);
    if (chunks_.size() > kMostChunks) chunks_.pop_back();
    return chunk;
  }

  HttpResponse ask(std::uint64_t offset, std::uint64_t bytes) {
    HttpRequest request = provider_.make_request(url_);
    request.headers_for_redirect = [this, headers = request.headers](const std::string& target) {
      policy_.check(target);
      return policy_.is_same_origin(target) ? headers : std::vector<std::string>();
    };
    request.headers.push_back("Range: bytes=" + std::to_string(offset) + "-" + std::to_string(offset + bytes - 1));
    request.headers.emplace_back("Accept-Encoding: identity");
    if (!tag_.empty()) request.headers.push_back("If-Match: " + tag_);
    HttpResponse response = client_.get(std::move(request));
    require_range(response, bytes);
    return response;
  }

  void require_range(const HttpResponse& response, std::uint64_t bytes) const {
    if (response.status == 412 ||
        (response.status == 206 && whole_length(response.header("content-range")) != length_ && length_ > 0))
      throw InputError(name(), "has changed while it was being read: run the command again");
    if (response.status == 200)
      throw InputError(name(), "the server sends only the whole file, no ranges of it: download it first");
    if (response.status != 206) {
      throw InputError(name(), mask_secrets("the server answered with status " + std::to_string(response.status),
                                            provider_.secrets()));
    }
    if (response.body.size() != bytes)
      throw InputError(name(), "the server sent " + std::to_string(response.body.size()) + " bytes instead of the " +
                                   std::to_string(bytes) + " asked for");
  }

  HttpProvider& provider_;
  HttpClient client_;
  std::string url_;
  OriginPolicy policy_;
  std::uint64_t length_ = 0;
  std::string tag_;  ///< strong ETag; empty: none
  std::mutex mutex_;
  std::list<std::pair<std::uint64_t, Chunk>> chunks_;  ///< latest first
};

RemoteArchiveSource::RemoteArchiveSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options,
                                         const ZipLimits& limits)
    : provider_(std::move(provider)), file_(std::make_shared<RangeReader>(*provider_, options)) {
  name_ = file_->name();
  const auto read_at = [file = file_](std::uint64_t offset, std::size_t length) { return file->read(offset, length); };
  archive_ = std::make_unique<ZipArchive>(read_at, file_->length(), name_, limits);
  if (!archive_->size("tileset.json")) throw InputError(name_, "the archive has no tileset.json");
}

RemoteArchiveSource::~RemoteArchiveSource() = default;

std::vector<std::byte> RemoteArchiveSource::read(const std::string& uri) {
  return archive_->read(path_in_archive(uri, name_));
}

std::optional<std::uintmax_t> RemoteArchiveSource::size(const std::string& uri) {
  try {
    return archive_->size(path_in_archive(uri, name_));
  } catch (const InputError&) {
    return std::nullopt;  // a path that may not be read has no size
  }
}

}  // namespace tileflight::fetch
