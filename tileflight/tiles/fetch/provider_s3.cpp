#include "tileflight/tiles/fetch/provider_s3.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::fetch {
namespace {

constexpr std::string_view kScheme = "s3://";

void append_escaped(std::string& out, char c) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  const auto byte = static_cast<unsigned char>(c);
  if (std::isalnum(byte) != 0 || std::string_view("-._~/").find(c) != std::string_view::npos) {
    out += c;
  } else {
    out += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
  }
}

/// Escapes a key. Percent signs are part of it.
std::string escaped_key(std::string_view key) {
  std::string out;
  for (const char c : key) append_escaped(out, c);
  return out;
}

bool is_bucket_name(std::string_view name) {
  const auto is_allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '.' || c == '_'; };
  return name.size() >= 3 && name.size() <= 63 && std::ranges::all_of(name, is_allowed) && !name.starts_with('.');
}

void require_variables(const std::string& source, const S3Options& options) {
  std::string missing;
  const auto require = [&](const std::string& value, const char* name) {
    if (value.empty()) missing += (missing.empty() ? "" : " and ") + std::string(name);
  };
  require(options.access_key_id, "AWS_ACCESS_KEY_ID");
  require(options.secret_access_key, "AWS_SECRET_ACCESS_KEY");
  if (options.endpoint_url.empty()) require(options.region, "AWS_REGION (or AWS_DEFAULT_REGION)");
  if (!missing.empty())
    throw InputError(source, "needs " + missing + " in the environment; a public bucket is read by its https:// URL");
}

std::string url_of_endpoint(std::string endpoint) {
  const std::string scheme = uri_scheme(endpoint);
  if ((scheme != "http" && scheme != "https") || endpoint.find_first_of("?#@") != std::string::npos)
    throw InputError("AWS_ENDPOINT_URL", "must be an http(s) URL without user name and query");
  while (endpoint.ends_with('/')) endpoint.pop_back();
  return endpoint;
}

std::string url_of_bucket(const std::string& bucket, const S3Options& options) {
  if (!options.endpoint_url.empty()) return url_of_endpoint(options.endpoint_url) + "/" + bucket + "/";
  const std::string host = "s3." + options.region + ".amazonaws.com" + (options.region.starts_with("cn-") ? ".cn" : "");
  // The certificate of *.s3… does not cover names with points.
  if (bucket.find('.') != std::string::npos) return "https://" + host + "/" + bucket + "/";
  return "https://" + bucket + "." + host + "/";
}

/// Returns the query in the form that is signed: parameters in the order of their names, "name" as "name=".
std::string signed_query(std::string_view query) {
  std::vector<std::string> parameters;
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    std::string parameter(query.substr(0, end));
    if (!parameter.empty())
      parameters.push_back(parameter.find('=') == std::string::npos ? parameter + "=" : parameter);
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  std::ranges::sort(parameters);
  std::string out;
  for (const std::string& parameter : parameters) out += (out.empty() ? "?" : "&") + parameter;
  return out;
}

}  // namespace

std::string s3_escaped_path(std::string_view path) {
  const auto is_hex = [](char c) { return std::isxdigit(static_cast<unsigned char>(c)) != 0; };
  std::string out;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] != '%' || i + 2 >= path.size() || !is_hex(path[i + 1]) || !is_hex(path[i + 2])) {
      append_escaped(out, path[i]);
      continue;
    }
    const auto byte = static_cast<char>(std::stoi(std::string(path.substr(i + 1, 2)), nullptr, 16));
    // An escaped slash is part of a name.
    if (byte == '/') {
      out += "%2F";
    } else {
      append_escaped(out, byte);
    }
    i += 2;
  }
  return out;
}

S3Provider::S3Provider(const std::string& source, S3Options options) : options_(std::move(options)) {
  const std::string rest = source.substr(std::min(kScheme.size(), source.size()));
  const std::size_t slash = std::min(rest.find('/'), rest.size());
  bucket_ = rest.substr(0, slash);
  key_ = rest.substr(std::min(slash + 1, rest.size()));
  if (!is_bucket_name(bucket_))
    throw InputError(source, "must have the form s3://BUCKET/KEY, as in s3://city/tileset.json");
  if (key_.empty() || key_.ends_with('/')) key_ += "tileset.json";
  require_variables(source, options_);
  if (options_.region.empty()) options_.region = "us-east-1";
  bucket_url_ = resolve_uri("", url_of_bucket(bucket_, options_));
}

std::string S3Provider::resolve_root_url(HttpClient& /*client*/) { return bucket_url_ + escaped_key(key_); }

void S3Provider::require_allowed(const std::string& uri) const {
  if (!uri.starts_with(bucket_url_))
    throw InputError(uri_for_message(uri), "lies outside the bucket " + bucket_ + ", for which the keys are");
}

HttpRequest S3Provider::make_request(const std::string& uri) {
  require_allowed(uri);
  const std::size_t query = std::min(uri.find('?'), uri.size());
  HttpRequest request;
  request.url = bucket_url_ +
                s3_escaped_path(std::string_view(uri).substr(bucket_url_.size(), query - bucket_url_.size())) +
                signed_query(std::string_view(uri).substr(std::min(query + 1, uri.size())));
  request.signature = AwsSignature{options_.region, options_.access_key_id, options_.secret_access_key};
  // Signed because it is given: libcurl 7.88 does not send it by itself, and S3 requires it.
  request.headers.push_back("x-amz-content-sha256: " + base::sha256_hex(""));  // of a request without a body
  if (!options_.session_token.empty()) request.headers.push_back("x-amz-security-token: " + options_.session_token);
  return request;
}

std::vector<std::string> S3Provider::secrets() const {
  return {options_.secret_access_key, options_.session_token, options_.access_key_id};
}

std::string S3Provider::explain(const std::string& code) const {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 9> kCures = {{
      {"InvalidAccessKeyId", "check AWS_ACCESS_KEY_ID"},
      {"SignatureDoesNotMatch", "check AWS_SECRET_ACCESS_KEY"},
      {"ExpiredToken", "AWS_SESSION_TOKEN has expired: obtain new keys"},
      {"InvalidToken", "check AWS_SESSION_TOKEN: it belongs to other keys, or is missing"},
      {"AccessDenied", "the keys do not permit it, or there is no such object"},
      {"RequestTimeTooSkewed", "set the clock of this machine"},
      {"AuthorizationHeaderMalformed", "check AWS_REGION: the bucket is in another region"},
      {"PermanentRedirect", "check AWS_REGION: the bucket is in another region"},
      {"NoSuchBucket", "check the bucket's name, AWS_REGION and AWS_ENDPOINT_URL"},
  }};
  const auto cure = std::ranges::find(kCures, code, &std::pair<std::string_view, std::string_view>::first);
  return cure == kCures.end() ? "" : std::string(cure->second);
}

TermsOfUse S3Provider::terms() const { return unknown_terms("s3://" + bucket_); }

}  // namespace tileflight::fetch
