#pragma once

#include <string>
#include <string_view>

#include "tileflight/tiles/fetch/http_options.h"
#include "tileflight/tiles/fetch/http_provider.h"

namespace tileflight::fetch {

/// Serves a bucket of an object store. Requests are signed by AWS Signature Version 4. Buckets are addressed by path
/// (ENDPOINT/BUCKET/KEY) at a given endpoint, and by host at Amazon's. Only objects of the bucket are requested.
class S3Provider : public HttpProvider {
 public:
  /// `source`: "s3://BUCKET/KEY". The key is not escaped; it names a folder if it ends in a slash. Throws InputError if
  /// `source` has another form or an environment variable is missing.
  S3Provider(const std::string& source, S3Options options);

  std::string resolve_root_url(HttpClient& client) override;
  HttpRequest make_request(const std::string& uri) override;
  void require_allowed(const std::string& uri) const override;
  std::vector<std::string> secrets() const override;
  std::string explain(const std::string& code) const override;
  TermsOfUse terms() const override;

 private:
  S3Options options_;
  std::string bucket_;
  std::string bucket_url_;  ///< with a slash at its end
  std::string key_;
};

/// Escapes every byte of a path except letters, digits, "-._~" and slashes, as AWS Signature Version 4 signs it.
/// Existing escapes are kept.
std::string s3_escaped_path(std::string_view path);

}  // namespace tileflight::fetch
