# What R says of the cases in study_cases.json, with all digits: study_r.json.
#
# Needs R 4.2 with car, effectsize, exactRankTests, coin, pwr and jsonlite (Debian:
# apt-get install r-base-core r-cran-car r-cran-effectsize r-cran-exactranktests r-cran-coin
# r-cran-pwr r-cran-jsonlite). The tests read its output; they do not need R.
#
#   Rscript tests/oracles/study.R
#
# Where a package has the quantity, the package computes it. Three intervals are in no Debian package
# and are computed here from their published formulas, by other means than in peaking: Bonett's d_av,
# the score interval of the rank-biserial (its variance by numeric integration), and the noncentral
# chi-squared limits.

suppressPackageStartupMessages({
  library(car)
  library(effectsize)
  library(exactRankTests)
  library(coin)
  library(pwr)
  library(jsonlite)
})
folder <- dirname(sub("--file=", "", grep("--file=", commandArgs(), value = TRUE)[1]))
cases <- fromJSON(file.path(folder, "study_cases.json"), simplifyVector = TRUE, simplifyMatrix = TRUE)
quietly <- function(expression) suppressWarnings(suppressMessages(expression))
root <- function(f, low, high) uniroot(f, c(low, high), tol = 1e-14, maxiter = 10000)$root
z <- qnorm(0.975)

levene <- function(samples) {
  values <- unlist(samples)
  group <- factor(rep(seq_along(samples), lengths(samples)))
  got <- leveneTest(values, group, center = median)
  list(statistic = got[1, "F value"], df = c(got[1, "Df"], got[2, "Df"]), p = got[1, "Pr(>F)"])
}

shapiro <- function(x) {
  got <- shapiro.test(x)
  list(statistic = unname(got$statistic), p = got$p.value)
}

bonett <- function(d, s2, of_scale, of_mean) {
  half <- z * sqrt(d^2 * of_scale / (8 * s2^2) + of_mean / s2)
  c(d, d - half, d + half)
}

# Expectation and standard deviation of the rank-biserial of m differences from N(shift, 1). Chances
# near 1 lose their digits when subtracted from 1, so that the negative side is the one computed.
signed_moments <- function(shift, m) {
  if (shift > 0) return(c(-1, 1) * signed_moments(-shift, m))
  p1 <- pnorm(shift)
  p2 <- pnorm(sqrt(2) * shift)
  p3 <- integrate(function(x) dnorm(x) * pnorm(2 * shift + x)^2, -Inf, Inf, rel.tol = 1e-13,
                  abs.tol = 0, subdivisions = 1000)$value
  most <- m * (m + 1) / 2
  variance <- m * p1 * (1 - p1) + m * (m - 1) / 2 * (p1^2 - 4 * p1 * p2 + 3 * p2 - 2 * p2^2) +
    m * (m - 1) * (m - 2) * (p3 - p2^2)
  c(2 * (m * p1 + m * (m - 1) / 2 * p2) / most - 1, 2 * sqrt(max(0, variance)) / most)
}

sum_moments <- function(shift, n1, n2) {
  if (shift > 0) return(c(-1, 1) * sum_moments(-shift, n1, n2))
  p <- pnorm(shift / sqrt(2))
  both <- integrate(function(x) dnorm(x) * pnorm(shift + x)^2, -Inf, Inf, rel.tol = 1e-13,
                    abs.tol = 0, subdivisions = 1000)$value
  variance <- (p * (1 - p) + (n1 + n2 - 2) * (both - p^2)) / (n1 * n2)
  c(2 * p - 1, 2 * sqrt(max(0, variance)))
}

score_limits <- function(r, moments, population) {
  # effectsize goes through a rank transform that leaves 1 off by rounding.
  if (abs(r) > 1 - 1e-12) r <- sign(r)
  off <- function(shift, sign) {
    m <- moments(shift)
    r - m[1] - sign * z * m[2]
  }
  low <- if (r <= -1) -1 else population(root(function(s) off(s, 1), -4, 4))
  high <- if (r >= 1) 1 else population(root(function(s) off(s, -1), -4, 4))
  c(low, high)
}

paired_case <- function(case) {
  x <- case$first
  y <- case$second
  d <- round(x - y, 9)
  n <- length(d)
  answer <- list(levene = levene(list(x, y)))
  if (diff(range(d)) > 0) {
    t <- t.test(x, y, paired = TRUE)
    dz <- cohens_d(x, y, paired = TRUE)
    s2 <- (var(x) + var(y)) / 2
    answer$shapiro <- shapiro(d)
    answer$t <- list(
      statistic = unname(t$statistic), df = unname(t$parameter), p = t$p.value,
      mean_difference = c(unname(t$estimate), t$conf.int[1:2]),
      d_z = c(unname(t$statistic) / sqrt(n), t_limits(unname(t$statistic), n - 1) / sqrt(n)),
      d_z_effectsize = c(dz$Cohens_d, dz$CI_low, dz$CI_high),
      d_av = bonett((mean(x) - mean(y)) / sqrt(s2), s2,
        (var(x)^2 + var(y)^2 + 2 * cor(x, y)^2 * var(x) * var(y)) / (n - 1), var(x - y) / (n - 1))
    )
  }
  kept <- d[d != 0]
  tied <- length(unique(abs(kept))) < length(kept) || length(kept) < n
  exact <- quietly(wilcox.exact(kept, rep(0, length(kept)), paired = TRUE, exact = TRUE))
  base <- quietly(wilcox.test(kept, exact = if (tied) FALSE else NULL, correct = TRUE))
  coin <- pvalue(wilcoxsign_test(kept ~ rep(0, length(kept)), distribution = "exact",
                                 zero.method = "Wilcoxon"))
  rb <- quietly(rank_biserial(d, mu = 0))
  answer$wilcoxon <- list(
    statistic = unname(base$statistic), p_exact = exact$p.value, p_coin = as.numeric(coin),
    p_base = base$p.value, base_is_exact = !tied && length(kept) < 50, r = rb$r_rank_biserial,
    r_limits = score_limits(rb$r_rank_biserial, function(s) signed_moments(s, length(kept)),
                            function(s) 2 * pnorm(sqrt(2) * s) - 1),
    r_effectsize = c(rb$r_rank_biserial, rb$CI_low, rb$CI_high)
  )
  walsh <- outer(d, d, "+") / 2
  walsh <- sort(walsh[lower.tri(walsh, diag = TRUE)])
  k <- if (n >= 50) ceiling(n * (n + 1) / 4 - z * sqrt(n * (n + 1) * (2 * n + 1) / 24)) else
    qsignrank(0.025, n)
  if (n >= 6) {
    answer$wilcoxon$hodges_lehmann <- c(median(walsh), walsh[k], walsh[length(walsh) + 1 - k])
    if (!tied && n < 50) {
      own <- wilcox.test(x, y, paired = TRUE, conf.int = TRUE)
      answer$wilcoxon$hodges_lehmann_base <- c(unname(own$estimate), own$conf.int[1:2])
    }
  }
  answer
}

t_limits <- function(t, df) {
  limit <- function(share) root(function(l) quietly(pt(t, df, ncp = l)) - share, t - 9, t + 9)
  c(limit(0.975), limit(0.025))
}

chi2_limits <- function(chi2, df, most) {
  low <- if (pchisq(chi2, df) <= 0.975) 0 else
    root(function(l) pchisq(chi2, df, ncp = l) - 0.975, 0, 10 * chi2)
  high <- if (pchisq(chi2, df) <= 0.025) 0 else
    root(function(l) pchisq(chi2, df, ncp = l) - 0.025, 0, 10 * chi2 + 50)
  pmin(1, c(low, high) / most)
}

f_limits <- function(f, df1, df2) {
  limit <- function(share) if (pf(f, df1, df2) <= share) 0 else
    root(function(l) pf(f, df1, df2, ncp = l) - share, 0, 10 * f * df1 + 50)
  l <- c(limit(0.975), limit(0.025))
  l / (l + df2)
}

eta2 <- function(f, df1, df2) {
  got <- F_to_eta2(f, df1, df2, ci = 0.95, alternative = "two.sided")
  c(got$Eta2_partial, f_limits(f, df1, df2), got$CI_low, got$CI_high)
}

# The published p-value (Anderson, An introduction to multivariate statistical analysis, 10.7.4).
# mauchly.test of R 4.2.2, which peaking follows, has the number of conditions in one place of Box's
# second term where the formula has the number of contrasts. Up to three conditions the term is 0.
mauchly_p <- function(w, n, m) {
  f <- n - 1
  rho <- 1 - (2 * m^2 + m + 2) / (6 * m * f)
  second <- (m + 2) * (m - 1) * (m - 2) * (2 * m^3 + 6 * m^2 + 3 * m + 2) / (288 * (f * m * rho)^2)
  chi2 <- -f * rho * log(w)
  df <- m * (m + 1) / 2 - 1
  p <- pchisq(chi2, c(df, df + 4), lower.tail = FALSE)
  p[1] + second * (p[2] - p[1])
}

repeated_case <- function(values) {
  n <- nrow(values)
  k <- ncol(values)
  model <- lm(values ~ 1)
  sphericity <- mauchly.test(model, X = ~1)
  table <- anova(model, X = ~1, test = "Spherical")
  epsilon <- as.numeric(sub(".*: *", "", grep("Greenhouse", attr(table, "heading"), value = TRUE)))
  s <- SSD(model)$SSD / (n - 1)
  contrasts <- contr.helmert(k) %*% diag(1 / sqrt(colSums(contr.helmert(k)^2)))
  e <- eigen(t(contrasts) %*% s %*% contrasts)$values
  gg <- sum(e)^2 / ((k - 1) * sum(e^2))
  stopifnot(abs(gg - epsilon) < 1e-3)
  f <- table[1, "F"]
  df <- c(table[1, "num Df"], table[1, "den Df"])
  friedman <- friedman.test(values)
  w <- kendalls_w(values, ci = NULL)
  list(
    mauchly = list(statistic = unname(sphericity$statistic),
                   p = mauchly_p(unname(sphericity$statistic), n, k - 1),
                   p_base = sphericity$p.value),
    epsilon = gg,
    anova = list(statistic = f, df = df, p = table[1, "Pr(>F)"], p_gg = table[1, "G-G Pr"],
                 eta2 = eta2(f, df[1], df[2]), eta2_gg = eta2(f, df[1] * gg, df[2] * gg)),
    friedman = list(statistic = unname(friedman$statistic), df = unname(friedman$parameter),
                    p = friedman$p.value, w = w$Kendalls_W,
                    w_limits = chi2_limits(unname(friedman$statistic), k - 1, n * (k - 1))),
    levene = levene(split(values, col(values)))
  )
}

groups_case <- function(samples) {
  answer <- list(levene = levene(samples), shapiro = lapply(samples, shapiro))
  if (length(samples) == 2) {
    x <- samples[[1]]
    y <- samples[[2]]
    t <- t.test(x, y)
    s2 <- (var(x) + var(y)) / 2
    d <- cohens_d(x, y, pooled_sd = FALSE)$Cohens_d
    exact <- quietly(wilcox.exact(x, y, exact = TRUE))
    base <- quietly(wilcox.test(x, y, correct = TRUE))
    rb <- quietly(rank_biserial(x, y))
    r <- rb$r_rank_biserial
    n <- lengths(samples)
    answer$welch <- list(
      statistic = unname(t$statistic), df = unname(t$parameter), p = t$p.value,
      mean_difference = c(mean(x) - mean(y), t$conf.int[1:2]),
      d_av = bonett(d, s2, var(x)^2 / (n[1] - 1) + var(y)^2 / (n[2] - 1),
                    var(x) / (n[1] - 1) + var(y) / (n[2] - 1))
    )
    answer$mann_whitney <- list(
      statistic = unname(base$statistic), p_exact = exact$p.value, p_base = base$p.value,
      base_is_exact = !any(duplicated(c(x, y))) && all(n < 50), r = r,
      r_limits = score_limits(r, function(s) sum_moments(s, n[1], n[2]),
                              function(s) 2 * pnorm(s / sqrt(2)) - 1),
      r_effectsize = c(r, rb$CI_low, rb$CI_high)
    )
  } else {
    values <- unlist(samples)
    group <- factor(rep(seq_along(samples), lengths(samples)))
    welch <- oneway.test(values ~ group)
    df <- unname(welch$parameter)
    kruskal <- kruskal.test(values, group)
    epsilon <- rank_epsilon_squared(values ~ group, ci = NULL)$rank_epsilon_squared
    answer$welch_anova <- list(statistic = unname(welch$statistic), df = df, p = welch$p.value,
                               eta2 = eta2(unname(welch$statistic), df[1], df[2]))
    answer$kruskal <- list(
      statistic = unname(kruskal$statistic), df = unname(kruskal$parameter), p = kruskal$p.value,
      epsilon2 = epsilon,
      epsilon2_limits = chi2_limits(unname(kruskal$statistic), length(samples) - 1, length(values) - 1)
    )
  }
  answer
}

crossover_case <- function(case) {
  began <- case$first_began
  test <- function(x) {
    t <- t.test(x[began], x[!began])
    list(statistic = unname(t$statistic), df = unname(t$parameter), p = t$p.value)
  }
  list(period = test(case$first - case$second), carry_over = test(case$first + case$second))
}

power_case <- function(n, d, alpha) {
  list(
    paired = pwr.t.test(n = n, d = d, sig.level = alpha, type = "paired")$power,
    two_sample = pwr.t.test(n = n, d = d, sig.level = alpha, type = "two.sample")$power,
    smallest_paired = power.t.test(n = n, sig.level = alpha, power = 0.8, type = "paired",
                                   strict = TRUE, tol = 1e-12)$delta,
    smallest_two_sample = power.t.test(n = n, sig.level = alpha, power = 0.8,
                                       strict = TRUE, tol = 1e-12)$delta
  )
}

as_samples <- function(x) if (is.matrix(x)) split(x, row(x)) else x

answers <- list(
  made_by = paste(R.version.string, "with", paste(
    sapply(c("car", "effectsize", "exactRankTests", "coin", "pwr"),
           function(p) paste(p, packageVersion(p))), collapse = ", ")),
  paired = lapply(cases$paired, paired_case),
  repeated = lapply(cases$repeated, repeated_case),
  groups = lapply(lapply(cases$groups, as_samples), groups_case),
  crossover = lapply(cases$crossover, crossover_case),
  families = lapply(cases$families, p.adjust, method = "holm"),
  power = Map(power_case, cases$power$n, cases$power$d, cases$power$alpha)
)
write(toJSON(answers, digits = NA, auto_unbox = TRUE, pretty = TRUE), file.path(folder, "study_r.json"))
