//! `#[derive(Cause)]`: the kind of a failure and the advice to the user, beside the message that thiserror derives.
//!
//! `#[cause(Kind: "advice")]` stands below `#[error("message")]`. On an enum it holds for each variant that does not
//! state its own; kind and advice may stand apart. A variant without either does not compile.
//!
//! `areograph_base::error`, which passes the macro on, has examples: dependencies of examples here would be built once
//! more, as dependencies of a compiler plug-in.
//!
//! - The advice is a format string. Fields are in scope by reference, under their names or as `_0`, `_1`; `{0}` is the
//!   first field, as with thiserror. Further arguments are those of [`format!`].
//! - A kind that depends on the fields is a call: `#[cause(kind_of(code): "{}", advice_on(code))]`.
//! - `#[cause(like = Other)]` takes kind and advice of another variant.

use proc_macro2::{Ident, Span, TokenStream};
use quote::{format_ident, quote};
use syn::{
    Attribute, Data, DataEnum, DeriveInput, Error, Expr, Fields, LitStr, Result, Token,
    parse::{Parse, ParseStream},
    parse_macro_input,
};

mod keyword {
    syn::custom_keyword!(like);
}

/// Derives `areograph_base::error::Cause`; the page of this crate describes the attributes.
#[proc_macro_derive(Cause, attributes(cause))]
pub fn derive_cause(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    expand(&input)
        .unwrap_or_else(Error::into_compile_error)
        .into()
}

/// Content of a `#[cause(…)]`.
#[derive(Default)]
struct Statement {
    kind: Option<Expr>,
    advice: Option<Advice>,
    like: Option<Ident>,
}

/// A format string and its arguments, from their first comma on.
#[derive(Clone)]
struct Advice {
    format: LitStr,
    arguments: TokenStream,
}

impl Parse for Statement {
    fn parse(input: ParseStream) -> Result<Self> {
        let mut statement = Self::default();
        if input.peek(keyword::like) && input.peek2(Token![=]) {
            input.parse::<keyword::like>()?;
            input.parse::<Token![=]>()?;
            statement.like = Some(input.parse()?);
            return Ok(statement);
        }
        if !input.peek(LitStr) {
            statement.kind = Some(input.parse()?);
            if input.is_empty() {
                return Ok(statement);
            }
            input.parse::<Token![:]>()?;
        }
        statement.advice = Some(Advice {
            format: input.parse()?,
            arguments: input.parse()?,
        });
        Ok(statement)
    }
}

impl Statement {
    fn of(attributes: &[Attribute]) -> Result<Self> {
        let mut own = attributes
            .iter()
            .filter(|attribute| attribute.path().is_ident("cause"));
        let Some(attribute) = own.next() else {
            return Ok(Self::default());
        };
        if let Some(second) = own.next() {
            return Err(Error::new_spanned(second, "a second `cause` attribute"));
        }
        attribute.parse_args()
    }

    fn or(self, other: &Self) -> Self {
        Self {
            kind: self.kind.or_else(|| other.kind.clone()),
            advice: self.advice.or_else(|| other.advice.clone()),
            like: None,
        }
    }
}

/// A struct or a variant, with the statement that holds for it.
struct Case<'input> {
    path: TokenStream,
    fields: &'input Fields,
    statement: Statement,
    /// Place at which a missing statement is reported.
    span: Span,
}

fn expand(input: &DeriveInput) -> Result<TokenStream> {
    let common = Statement::of(&input.attrs)?;
    if let Some(like) = &common.like {
        return Err(Error::new_spanned(like, "`like` is for variants"));
    }
    let cases = match &input.data {
        Data::Enum(variants) => cases(variants, &common)?,
        Data::Struct(data) => vec![Case {
            path: quote!(Self),
            fields: &data.fields,
            statement: common,
            span: input.ident.span(),
        }],
        Data::Union(_) => {
            return Err(Error::new_spanned(
                &input.ident,
                "a union cannot be a cause",
            ));
        }
    };
    let kinds = cases.iter().map(Case::kind).collect::<Result<Vec<_>>>()?;
    let advice = cases.iter().map(Case::advice).collect::<Result<Vec<_>>>()?;
    let name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    Ok(quote! {
        #[automatically_derived]
        #[allow(unused_variables, clippy::match_same_arms, clippy::used_underscore_binding)]
        impl #generics ::areograph_base::error::Cause for #name #arguments #bounds {
            fn kind(&self) -> ::areograph_base::error::Kind {
                match self { #(#kinds)* }
            }

            fn advice(&self) -> ::std::string::String {
                match self { #(#advice)* }
            }
        }
    })
}

fn cases<'input>(variants: &'input DataEnum, common: &Statement) -> Result<Vec<Case<'input>>> {
    let mut cases = Vec::new();
    for variant in &variants.variants {
        let mut statement = Statement::of(&variant.attrs)?;
        if let Some(like) = &statement.like {
            let mut others = variants.variants.iter();
            let other = others.find(|other| other.ident == *like);
            let other =
                other.ok_or_else(|| Error::new_spanned(like, "no variant has this name"))?;
            statement = Statement::of(&other.attrs)?;
            if let Some(like) = &statement.like {
                return Err(Error::new_spanned(
                    like,
                    "the variant that `like` names must not use `like` itself",
                ));
            }
        }
        let name = &variant.ident;
        cases.push(Case {
            path: quote!(Self::#name),
            fields: &variant.fields,
            statement: statement.or(common),
            span: name.span(),
        });
    }
    Ok(cases)
}

impl Case<'_> {
    /// The arm of `kind`.
    fn kind(&self) -> Result<TokenStream> {
        let path = &self.path;
        match &self.statement.kind {
            None => Err(Error::new(self.span, "no kind: add #[cause(Kind)]")),
            Some(Expr::Path(kind)) if kind.path.get_ident().is_some() => {
                Ok(quote!(#path { .. } => ::areograph_base::error::Kind::#kind,))
            }
            Some(kind) => {
                let fields = self.bound_fields();
                Ok(quote!(#path #fields => #kind,))
            }
        }
    }

    /// The arm of `advice`.
    fn advice(&self) -> Result<TokenStream> {
        let missing = || Error::new(self.span, "no advice: add #[cause(\"advice\")]");
        let advice = self.statement.advice.as_ref().ok_or_else(missing)?;
        let (path, arguments) = (&self.path, &advice.arguments);
        let format = with_named_fields(&advice.format);
        if arguments.is_empty() && !format.value().contains(['{', '}']) {
            return Ok(quote!(#path { .. } => ::std::borrow::ToOwned::to_owned(#format),));
        }
        let fields = self.bound_fields();
        Ok(quote!(#path #fields => ::std::format!(#format #arguments),))
    }

    /// The pattern of the fields that brings all of them into scope.
    fn bound_fields(&self) -> TokenStream {
        match self.fields {
            Fields::Named(fields) => {
                let names = fields.named.iter().map(|field| &field.ident);
                quote!({ #(#names),* })
            }
            Fields::Unnamed(fields) => {
                let names = (0..fields.unnamed.len()).map(|index| format_ident!("_{index}"));
                quote!((#(#names),*))
            }
            Fields::Unit => TokenStream::new(),
        }
    }
}

/// The format string with `{_0}` for `{0}`, since the fields of a tuple are bound as `_0`, `_1`.
fn with_named_fields(format: &LitStr) -> LitStr {
    let text = format.value();
    let mut named = String::with_capacity(text.len() + 1);
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        named.push(character);
        if character != '{' {
            continue;
        }
        match characters.peek() {
            Some('{') => named.extend(characters.next()),
            Some(digit) if digit.is_ascii_digit() => named.push('_'),
            _ => {}
        }
    }
    LitStr::new(&named, format.span())
}

#[cfg(test)]
mod tests {
    use syn::parse_quote;

    use super::*;

    fn refusal(input: &DeriveInput) -> String {
        expand(input).unwrap_err().to_string()
    }

    #[test]
    fn what_is_not_stated_is_refused() {
        assert_eq!(
            refusal(&parse_quote!(
                #[cause("run again")]
                struct Stopped;
            )),
            "no kind: add #[cause(Kind)]"
        );
        assert_eq!(
            refusal(&parse_quote!(
                #[cause(Input)]
                enum TableError {
                    #[cause("give a table with rows")]
                    Empty,
                    Truncated,
                }
            )),
            "no advice: add #[cause(\"advice\")]"
        );
    }

    #[test]
    fn a_variant_is_like_one_that_states_its_own() {
        assert_eq!(
            refusal(&parse_quote!(
                enum TableError {
                    #[cause(like = Rows)]
                    Empty,
                }
            )),
            "no variant has this name"
        );
        assert_eq!(
            refusal(&parse_quote!(
                enum TableError {
                    #[cause(like = Empty)]
                    Empty,
                }
            )),
            "the variant that `like` names must not use `like` itself"
        );
    }

    #[test]
    fn braces_and_numbers_keep_their_meaning() {
        let named = |text| with_named_fields(&LitStr::new(text, Span::call_site())).value();
        assert_eq!(named("{0:?} and {{0}} of {1}"), "{_0:?} and {{0}} of {_1}");
    }
}
