#include "tileflight/tiles/fetch/archive_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <string>

#include "tests/refusal.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/test_http_server.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::fetch::remote_archive_test {
namespace {

using test_support::ServedConnection;
using test_support::ServedRequest;
using test_support::TestHttpServer;
using ::testing::HasSubstr;
using tests::refusal_of;

/// A server of one file; counts the bytes that it sends.
class FileServer {
 public:
  explicit FileServer(std::string file)
      : file_(std::move(file)), server_([this](const ServedRequest& request, ServedConnection& connection) {
          return answer(request, connection);
        }) {}

  SourceOptions options() const {
    SourceOptions options;
    options.http.http.retry.max_tries = 1;
    return options;
  }
  std::string url() const { return server_.url("/city.3tz"); }
  std::size_t sent() const { return sent_; }

  bool knows_ranges = true;
  std::string tag = "\"1\"";

 private:
  bool answer(const ServedRequest& request, ServedConnection& connection) {
    if (!knows_ranges) return connection.answer(200, file_);
    const std::string wanted = request.header("if-match"), range = request.header("range");
    if (!wanted.empty() && wanted != tag) return connection.answer(412, "");
    const std::size_t dash = range.find('-');
    const std::size_t begin = std::stoull(range.substr(6, dash - 6));
    const std::size_t end = std::min<std::size_t>(std::stoull(range.substr(dash + 1)) + 1, file_.size());
    sent_ += end - begin;
    return connection.answer(206, file_.substr(begin, end - begin),
                             {"ETag: " + tag, "Content-Range: bytes " + std::to_string(begin) + "-" +
                                                  std::to_string(end - 1) + "/" + std::to_string(file_.size())});
  }

  std::string file_;
  std::atomic<std::size_t> sent_ = 0;
  TestHttpServer server_;
};

std::string archive() {
  std::vector<test_support::ZipEntry> entries{{"tileset.json", "{\"asset\": 1}"}};
  for (int i = 0; i < 40; ++i)
    entries.push_back({std::to_string(i) + ".glb", std::string(100'000, static_cast<char>('a' + i % 26))});
  entries.push_back({"large.glb", std::string(700'000, '#')});
  return test_support::make_zip(entries);
}

std::string text_at(TileSource& source, const std::string& uri) {
  const std::vector<std::byte> bytes = source.read(uri);
  return std::string(base::as_text(bytes));
}

TEST(RemoteArchive, ReadsEntriesWithoutTheWholeFile) {
  FileServer server(archive());
  const auto source = open_source(server.url(), server.options());
  EXPECT_EQ(text_at(*source, source->root_uri()), "{\"asset\": 1}");
  EXPECT_EQ(text_at(*source, "17.glb"), std::string(100'000, 'r'));
  EXPECT_EQ(text_at(*source, "18.glb"), std::string(100'000, 's'));
  EXPECT_EQ(text_at(*source, "large.glb"), std::string(700'000, '#'));
  EXPECT_EQ(source->size("large.glb"), 700'000U);
  EXPECT_LT(server.sent(), 3'000'000U) << "of 4.7 MB";
  EXPECT_THAT(refusal_of([&] { source->read("41.glb"); }), HasSubstr("41.glb"));
  EXPECT_THAT(refusal_of([&] { source->read("../x"); }), HasSubstr("outside the archive"));
}

TEST(RemoteArchive, NoticesThatTheFileChanges) {
  FileServer server(archive());
  const auto source = open_source(server.url(), server.options());
  server.tag = "\"2\"";
  EXPECT_THAT(refusal_of([&] { source->read("5.glb"); }), HasSubstr("has changed while it was being read"));
}

TEST(RemoteArchive, OneLineWhereTheServerKnowsNoRanges) {
  FileServer server(archive());
  server.knows_ranges = false;
  EXPECT_THAT(refusal_of([&] { open_source(server.url(), server.options()); }), HasSubstr("download it first"));
  FileServer other("not an archive at all");
  EXPECT_THAT(refusal_of([&] { open_source(other.url(), other.options()); }), HasSubstr("city.3tz"));
  EXPECT_THAT(refusal_of([] { open_source("http://127.0.0.1:1/city.3dtiles"); }), HasSubstr("download it first"));
}

}  // namespace
}  // namespace tileflight::fetch::remote_archive_test
