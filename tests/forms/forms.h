/// Forms of policies that the tests add to those of the product; `make FORMS=tests/forms` compiles them in.
#define IVL_FORMS_OWN(X) X(six) X(most)
